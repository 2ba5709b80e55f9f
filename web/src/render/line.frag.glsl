#version 300 es
// A line of the guide's marks.
precision mediump float;

in vec4 colour;
out vec4 painted;

void main() {
  painted = colour;
}
