#version 300 es
// One line of the guide's marks as a quad that faces the screen. CONVENTIONS.md: x right, y down.
precision highp float;

layout(location = 0) in vec3 begin; // m, in the world or in the camera
layout(location = 1) in vec3 end;
layout(location = 2) in vec4 paint; // colour, and opacity
layout(location = 3) in float width; // of the line, in units of `unit_px`

uniform mat3 rotation; // cam_from_begin
uniform vec3 translation;
uniform vec4 pinhole; // fx, fy, cx, cy
uniform vec2 picture; // px
uniform vec2 viewport; // px
uniform float unit_px;
uniform float rim_px; // dark rim around the line; 0 for the line itself

out vec4 colour;

const float NEAR = 0.01;

vec2 ndc(vec3 p) {
  vec2 px = pinhole.xy * p.xy / p.z + pinhole.zw;
  return vec2(2.0 * px.x / picture.x - 1.0, 1.0 - 2.0 * px.y / picture.y);
}

void main() {
  vec3 a = rotation * begin + translation;
  vec3 b = rotation * end + translation;
  if (a.z <= NEAR && b.z <= NEAR) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  // What is behind the camera is cut off.
  if (a.z < NEAR) a = mix(a, b, (NEAR - a.z) / (b.z - a.z));
  if (b.z < NEAR) b = mix(b, a, (NEAR - b.z) / (a.z - b.z));
  vec2 from = ndc(a);
  vec2 to = ndc(b);
  vec2 along = (to - from) * viewport;
  float length_px = length(along);
  along = length_px > 1e-3 ? along / length_px : vec2(1.0, 0.0);
  float half_px = 0.5 * width * unit_px + rim_px;
  bool at_end = (gl_VertexID & 1) == 1;
  float side = (gl_VertexID >> 1) == 1 ? 1.0 : -1.0;
  vec2 step_px = half_px * (vec2(-along.y, along.x) * side + along * (at_end ? 1.0 : -1.0));
  gl_Position = vec4((at_end ? to : from) + 2.0 * step_px / viewport, 0.0, 1.0);
  colour = rim_px > 0.0 ? vec4(0.0, 0.0, 0.0, 0.45 * paint.a) : paint;
}
