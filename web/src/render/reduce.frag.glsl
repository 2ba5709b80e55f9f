#version 300 es
// A picture at a smaller size: the mean over each pixel's area, premultiplied.
precision highp float;

uniform sampler2D picture;
uniform vec2 size; // of the result
uniform int taps; // per axis; each looks at up to 2 x 2 texels

in vec2 uv;
out vec4 colour;

void main() {
  vec4 sum = vec4(0.0);
  for (int y = 0; y < taps; y++) {
    for (int x = 0; x < taps; x++) {
      vec2 step = (vec2(x, y) + 0.5) / float(taps) - 0.5;
      sum += texture(picture, uv + step / size);
    }
  }
  colour = sum / float(taps * taps);
}
