#version 300 es
// A rendering that is blended under what is there; twin of draw_under in src/peaking/rendering/.
precision highp float;

uniform sampler2D view; // premultiplied

in vec2 uv;
out vec4 colour;

void main() {
  colour = texture(view, uv);
}
