#version 300 es
// The live picture at the size of the view: the mean over each pixel's area.
precision highp float;

uniform sampler2D live;
uniform int taps; // per axis; each looks at up to 2 x 2 texels

in vec2 uv;
out vec4 colour;

void main() {
  vec2 pixel = vec2(dFdx(uv.x), dFdy(uv.y));
  vec3 sum = vec3(0.0);
  for (int y = 0; y < taps; y++) {
    for (int x = 0; x < taps; x++) {
      vec2 step = (vec2(x, y) + 0.5) / float(taps) - 0.5;
      sum += texture(live, uv + step * pixel).rgb;
    }
  }
  colour = vec4(sum / float(taps * taps), 1.0);
}
