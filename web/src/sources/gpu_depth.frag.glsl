#version 300 es
// Depth of a texture, turned to the picture's frame, as 16-bit millimetres in red (low) and green.
precision highp float;
precision highp int;

#if defined(IS_ARRAY) && defined(IS_UNSIGNED_SHORT)
uniform highp usampler2DArray depth;
#elif defined(IS_ARRAY)
uniform highp sampler2DArray depth;
#elif defined(IS_UNSIGNED_SHORT)
uniform highp usampler2D depth;
#else
uniform highp sampler2D depth;
#endif

#ifdef IS_ARRAY
uniform int layer;
#define FETCH(at) texelFetch(depth, ivec3(at, layer), 0)
#else
#define FETCH(at) texelFetch(depth, at, 0)
#endif

// From the picture (top left origin) to the buffer, both 0…1.
uniform mat4 buffer_from_picture;
uniform vec2 picture_size;
uniform float mm_per_unit;

const float SATURATED = 65535.0;

out vec4 colour;

void main() {
  // The first row that is read back is the top one.
  vec2 at = (buffer_from_picture * vec4(gl_FragCoord.xy / picture_size, 0.0, 1.0)).xy;
  vec2 size = vec2(textureSize(depth, 0).xy);
  ivec2 texel = ivec2(floor(at * size));
  colour = vec4(0.0);
  if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, ivec2(size)))) return;
#if defined(IS_UNSIGNED_SHORT)
  float value = float(FETCH(texel).r);
#elif defined(IS_LUMINANCE_ALPHA)
  vec4 bytes = FETCH(texel);
  float value = dot(floor(255.0 * bytes.ra + 0.5), vec2(1.0, 256.0));
#else
  float value = FETCH(texel).r;
#endif
  float mm = floor(value * mm_per_unit + 0.5);
  // What is not a number, not in front, saturated or too far for 16 bits is unknown.
#if defined(IS_UNSIGNED_SHORT) || defined(IS_LUMINANCE_ALPHA)
  if (value == SATURATED) return;
#endif
  if (!(mm > 0.0 && mm < SATURATED)) return;
  float high = floor(mm / 256.0);
  colour = vec4(mm - 256.0 * high, high, 0.0, 255.0) / 255.0;
}
