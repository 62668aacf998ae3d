#pragma once

/// The programs of the renderer, GLSL 3.30. All positions are relative to `Figure::origin`, in m.
namespace subworld::shaders {

inline constexpr const char* kBodyVertex = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 edge;
layout(location = 3) in float stretch;
layout(location = 4) in vec3 place;
layout(location = 5) in vec4 orientation;
layout(location = 6) in vec3 scale;
layout(location = 7) in float half_length;
layout(location = 8) in vec3 colour;
uniform mat4 view_projection;
out vec3 world_position;
out vec3 world_normal;
out vec3 edge_distance;
out vec3 body_colour;
invariant gl_Position;  // the colour pass must meet the depths of the depth pass exactly
vec3 turn(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
void main() {
  world_position = place + turn(orientation, position * scale + vec3(0.0, 0.0, stretch * half_length));
  world_normal = turn(orientation, normal / scale);
  edge_distance = edge;
  body_colour = colour;
  gl_Position = view_projection * vec4(world_position, 1.0);
}
)";

inline constexpr const char* kDepthFragment = R"(#version 330 core
void main() {}
)";

/// Common to the body and ground programs: the share of the key light that reaches a point.
inline constexpr const char* kShadow = R"(#version 330 core
uniform sampler2DShadow shadow_map;
uniform mat4 light_projection;
uniform float shadow_texel;  // m
float lit(vec3 point, vec3 normal) {
  // From a little above the surface: it must not shade itself.
  vec3 p = (light_projection * vec4(point + 1.5 * shadow_texel * normal, 1.0)).xyz * 0.5 + 0.5;
  if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return 1.0;
  vec2 texel = 1.0 / vec2(textureSize(shadow_map, 0));
  float sum = 0.0;
  for (int i = -1; i <= 1; ++i)
    for (int k = -1; k <= 1; ++k) sum += texture(shadow_map, vec3(p.xy + 1.3 * texel * vec2(i, k), p.z));
  return sum / 9.0;
}
vec3 linear(vec3 srgb) { return pow(srgb, vec3(2.2)); }
vec3 srgb(vec3 linear) { return pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)); }
)";

inline constexpr const char* kBodyFragment = R"(
in vec3 world_position;
in vec3 world_normal;
in vec3 edge_distance;
in vec3 body_colour;
uniform vec3 eye;
uniform vec3 key_light;
uniform vec3 fill_light;
uniform float shadow_strength;
uniform float edge_pixels;
uniform float flatness;  // 0: shaded, 1: the plain colour
uniform bool glass;
out vec4 result;
float edge_line() {
  vec3 gradient = vec3(length(vec2(dFdx(edge_distance.x), dFdy(edge_distance.x))),
                       length(vec2(dFdx(edge_distance.y), dFdy(edge_distance.y))),
                       length(vec2(dFdx(edge_distance.z), dFdy(edge_distance.z))));
  gradient = max(gradient, vec3(1e-6));
  vec3 pixels = max(edge_distance, 0.0) / gradient;
  vec3 size = 1.0 / gradient;  // small bodies would be nothing but edges
  vec3 width = edge_pixels * clamp(size / 45.0, 0.45, 1.0);
  vec3 line = 1.0 - smoothstep(width - 0.6, width + 0.6, pixels);
  line *= smoothstep(3.0, 18.0, size);
  return max(line.x, max(line.y, line.z));
}
void main() {
  vec3 view = normalize(eye - world_position);
  vec3 n = normalize(world_normal);
  if (dot(n, view) < 0.0) n = -n;
  float line = edge_line();
  if (glass) {
    float face = mix(0.07, 0.22, smoothstep(0.5, 0.9, abs(n.z)));
    result = vec4(mix(body_colour, body_colour * 0.55, line), mix(face, 0.65, line));
    return;
  }
  vec3 albedo = linear(body_colour);
  float light = mix(1.0, lit(world_position, n), shadow_strength);
  float key = max(dot(n, key_light), 0.0) * light;
  float fill = max(dot(n, fill_light), 0.0);
  vec3 sky = mix(vec3(0.40, 0.40, 0.41), vec3(0.58, 0.58, 0.58), n.z * 0.5 + 0.5);
  vec3 shaded = albedo * (sky + 0.52 * key + 0.14 * fill);
  float shine = pow(max(dot(n, normalize(key_light + view)), 0.0), 40.0);
  shaded += 0.10 * shine * light;
  shaded *= 1.0 - 0.35 * pow(1.0 - max(dot(n, view), 0.0), 3.0);
  shaded = mix(shaded, albedo * 0.12, 0.85 * line);
  result = vec4(srgb(mix(shaded, albedo, flatness)), 1.0);
}
)";

inline constexpr const char* kGroundVertex = R"(#version 330 core
const vec2 corners[4] = vec2[](vec2(-1.0, -1.0), vec2(1.0, -1.0), vec2(-1.0, 1.0), vec2(1.0, 1.0));
uniform mat4 view_projection;
uniform vec3 origin;
uniform vec3 axis_x;
uniform vec3 axis_y;
uniform float reach;
out vec3 world_position;
out vec2 plane;
void main() {
  plane = reach * corners[gl_VertexID];
  world_position = origin + plane.x * axis_x + plane.y * axis_y;
  gl_Position = view_projection * vec4(world_position, 1.0);
}
)";

inline constexpr const char* kGroundFragment = R"(
in vec3 world_position;
in vec2 plane;
uniform vec2 offset;   // of the origin in the grid, less than ten lines
uniform float spacing;
uniform float reach;
out vec4 result;
float grid(float every, float pixels) {
  vec2 u = (plane + offset) / every;
  vec2 width = max(fwidth(u), vec2(1e-6));
  vec2 away = abs(fract(u - 0.5) - 0.5) / width;
  vec2 line = 1.0 - smoothstep(pixels - 0.5, pixels + 0.5, away);
  line *= 1.0 - smoothstep(0.08, 0.3, width);
  return max(line.x, line.y);
}
void main() {
  float fade = 1.0 - smoothstep(0.25, 1.0, length(plane) / reach);
  float line = max(0.45 * grid(spacing, 0.6), 0.8 * grid(10.0 * spacing, 0.9));
  float shade = 0.42 * (1.0 - lit(world_position, vec3(0.0)));
  float alpha = 1.0 - (1.0 - 0.55 * fade) * (1.0 - line * fade) * (1.0 - shade);
  vec3 colour = mix(vec3(0.90, 0.91, 0.92), vec3(0.66, 0.69, 0.73), line);
  result = vec4(mix(colour, vec3(0.30, 0.32, 0.36), shade), alpha);
}
)";

inline constexpr const char* kSkyVertex = R"(#version 330 core
out float height;
void main() {
  vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 4.0 - 1.0;
  height = corner.y * 0.5 + 0.5;
  gl_Position = vec4(corner, 1.0, 1.0);
}
)";

inline constexpr const char* kSkyFragment = R"(#version 330 core
in float height;
out vec4 result;
void main() { result = vec4(mix(vec3(1.0), vec3(0.93, 0.95, 0.97), smoothstep(0.2, 1.0, height)), 1.0); }
)";

}  // namespace subworld::shaders
