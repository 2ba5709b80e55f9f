#version 300 es
// Depth of a plane where it is opaque: (alpha * depth, 0, 0, alpha), to be put over what lies behind.
precision highp float;

uniform sampler2D atlas; // premultiplied

in vec2 texel;
out vec4 colour;

void main() {
  float alpha = texture(atlas, texel).a;
  colour = vec4(alpha / gl_FragCoord.w, 0.0, 0.0, alpha); // 1/w is the depth, see mpi.vert.glsl
}
