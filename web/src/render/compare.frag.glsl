#version 300 es
// L1 over RGB between the view and the live picture; twin of src/peaking/error_map/.
precision highp float;

uniform sampler2D view; // premultiplied
uniform sampler2D live;
uniform vec3 gain; // live / view, per channel
uniform float threshold;
uniform int shift_px;

out vec4 result; // peaked, missing, error / 3, 1

const float MIN_ALPHA = 0.5;

vec3 rendered(ivec2 at) {
  vec4 c = texelFetch(view, at, 0);
  return clamp((c.a > 0.0 ? c.rgb / c.a : vec3(0.0)) * gain, 0.0, 1.0);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  ivec2 last = textureSize(view, 0) - 1;
  vec3 video = texelFetch(live, at, 0).rgb;
  float error = 9.0;
  for (int y = -shift_px; y <= shift_px; y++) {
    for (int x = -shift_px; x <= shift_px; x++) {
      vec3 differs = abs(rendered(clamp(at + ivec2(x, y), ivec2(0), last)) - video);
      error = min(error, differs.r + differs.g + differs.b);
    }
  }
  float missing = texelFetch(view, at, 0).a < MIN_ALPHA ? 1.0 : 0.0;
  result = vec4(error > threshold ? 1.0 : 0.0, missing, error / 3.0, 1.0);
}
