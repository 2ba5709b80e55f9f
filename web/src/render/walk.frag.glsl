#version 300 es
// A view of a light field on the screen; what no view shows is calm and hatched, as while capturing.
precision highp float;

uniform sampler2D view; // premultiplied
uniform float pixel_ratio; // pixels of the screen per pixel of its patterns

in vec2 uv;
out vec4 colour;

// As in display.frag.glsl.
const vec3 UNSEEN = vec3(0.59, 0.65, 0.75);
const float HATCH_PX = 9.0;

float line(float along, float every_px) {
  return 1.0 - smoothstep(0.5, 1.5, abs(mod(along, every_px) - 1.0));
}

void main() {
  vec4 seen = texture(view, uv);
  vec2 at = vec2(gl_FragCoord.x, -gl_FragCoord.y) / pixel_ratio;
  vec3 calm = mix(0.09 * UNSEEN, 0.22 * UNSEEN, line(at.x + at.y, HATCH_PX));
  colour = vec4(seen.rgb + (1.0 - seen.a) * calm, 1.0);
}
