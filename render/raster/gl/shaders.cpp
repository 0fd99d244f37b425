#include "render/raster/gl/shaders.hpp"

namespace throng::render::gl {
namespace {

// Mirrors FrameUniforms of gl_rasterizer.cpp and InstanceShade of scene.hpp. "Relative" is relative
// to the eye.
constexpr char kCommon[] = R"(#version 450 core
layout(std140, binding = 0) uniform Frame {
  mat4 clip_from_relative;
  vec4 sun_direction;   // unit; w: ground height relative to the eye
  vec4 sun_color;       // w: 1 where the eye is above the ground
  vec4 sky_color;       // w: 1 where the ground is drawn
  vec4 ground_light;    // w: 1 where shadows are drawn
  vec4 horizon_color;   // w: 1 for an orthographic camera
  vec4 ground_color;    // w: share of haze a metre
  // of pixel (0, 0), and a pixel's step. ray_origin.w: alpha of what is drawn before the shadows
  vec4 ray_origin, ray_origin_x, ray_origin_y;
  vec4 ray_direction, ray_direction_x, ray_direction_y;  // ray_direction.w: shadows' depth, metres over the ground
  vec4 grid;            // xy: the eye's place within 20 m; zw: the tile's first pixel
} frame;

const float kExposure = 0.62;

// Keeps hue and leaves everything under 0.76 as it is; what is brighter is compressed towards white.
vec3 tone_map(vec3 color) {
  color *= kExposure;
  float peak = max(color.r, max(color.g, color.b));
  const float start = 0.76;
  if (peak <= start) return color;
  float room = 1.0 - start;
  float new_peak = 1.0 - room * room / (peak - start + room);
  color *= new_peak / peak;
  float whiten = 1.0 - 1.0 / (0.15 * (peak - new_peak) + 1.0);
  return mix(color, vec3(new_peak), whiten);
}

// Air between the eye and a point.
vec3 haze(vec3 color, float distance_m) {
  return mix(frame.horizon_color.rgb, color, exp2(-distance_m * frame.ground_color.w));
}
)";

constexpr char kInstances[] = R"(
struct Instance {
  vec4 feet;      // relative; w: height in metres
  uvec4 tints;    // skin, hair, top, bottom: element::pack_tint
  uint layer;     // of the textures; highest bit: shows tones instead
  uint channel;   // colour of the channel, 0xffffffff: none
  float cast_shadow;  // share of the shadow that is drawn as a projected figure; 2: no blob at all
  float size_px;
};
layout(std430, binding = 1) readonly buffer Instances { Instance instances[]; };
const float kFloor = 0.04;  // element::kFloorM

vec3 unpack_color(uint bits) {
  vec3 root = vec3(bits & 1023u, (bits >> 10) & 1023u, (bits >> 20) & 1023u) * (1.0 / 1023.0);
  return root * root;
}
)";

constexpr char kAgentVertex[] = R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 octahedral;
layout(location = 2) in vec2 uv;
layout(location = 3) in uint visible;
out vec3 v_position;
out vec3 v_normal;
out vec3 v_uv_ao;
flat out uint v_visible;
void main() {
  vec3 normal = vec3(octahedral, 1.0 - abs(octahedral.x) - abs(octahedral.y));
  float fold = max(-normal.z, 0.0);
  normal.x += normal.x >= 0.0 ? -fold : fold;
  normal.y += normal.y >= 0.0 ? -fold : fold;
  // legs stand in the crowd's and the ground's own shade
  float height = position.z - instances[visible].feet.z;
  v_position = position;
  v_normal = normal;
  v_uv_ao = vec3(uv, mix(0.55, 1.0, smoothstep(-0.05, 0.75, height)));
  v_visible = visible;
  gl_Position = frame.clip_from_relative * vec4(position, 1.0);
}
)";

// Sun, sky, rim and gloss, haze and tone map: of a place of an agent's surface.
constexpr char kLight[] = R"(
vec3 lit_color(vec3 albedo, vec3 n, vec3 position, float ao) {
  vec3 sun = frame.sun_direction.xyz;
  vec3 to_eye = frame.horizon_color.w > 0.5 ? -frame.ray_direction.xyz : -normalize(position);

  // wrapped diffuse: skin and cloth scatter a little light past the edge of the shade
  float facing = clamp((dot(n, sun) + 0.22) * (1.0 / 1.22), 0.0, 1.0);
  facing *= mix(facing, 1.0, 0.6);
  vec3 sky_share = mix(frame.ground_light.rgb, frame.sky_color.rgb, 0.5 + 0.5 * n.z);
  vec3 light = frame.sun_color.rgb * (facing * mix(0.75, 1.0, ao)) + sky_share * ao;

  float edge = 1.0 - clamp(dot(n, to_eye), 0.0, 1.0);
  float rim = edge * edge * edge * (0.35 + 0.65 * n.z * n.z) * 0.16;
  vec3 half_way = normalize(sun + to_eye);
  float gloss = clamp(dot(n, half_way), 0.0, 1.0);
  gloss *= gloss; gloss *= gloss; gloss *= gloss; gloss *= gloss;
  vec3 lit = albedo * light + frame.sky_color.rgb * (rim * ao) + frame.sun_color.rgb * (gloss * facing * 0.035);
  return tone_map(haze(lit, frame.horizon_color.w > 0.5 ? 0.0 : length(position)));
}

// The tints of an instance on what its mask weighs.
vec3 tinted(vec3 albedo, vec4 mask, uvec4 tints) {
  vec3 tint = mask.r * unpack_color(tints.x) + mask.g * unpack_color(tints.y) +
              mask.b * unpack_color(tints.z) + mask.a * unpack_color(tints.w);
  return albedo * (max(0.0, 1.0 - dot(mask, vec4(1.0))) + 2.0 * tint);  // element::pack_tint stores halves
}

// The channel's colour with a hint of the texture, so that the figure stays readable.
vec3 channel_color(uint channel, vec3 base) {
  return unpack_color(channel) * (0.55 + 0.45 * sqrt(dot(base, vec3(0.2126, 0.7152, 0.0722))));
}
)";

// Colours of coarse levels, by triangle: mirrors CornerTones and BatchVertex.
constexpr char kTones[] = R"(
layout(std430, binding = 7) readonly buffer Vertices { float vertex_words[]; };  // six each
layout(std430, binding = 8) readonly buffer Indices { uint indices[]; };
layout(std430, binding = 9) readonly buffer Tones { uint tones[]; };
// by instance: what to add to three times a triangle's number
layout(std430, binding = 10) readonly buffer ToneShifts { uint tone_shift[]; };
layout(location = 0) uniform int has_vertices;  // 0: more than a shader can see

vec3 corner_position(uint k) {
  uint at = 6u * indices[3u * uint(gl_PrimitiveID) + k];
  return vec3(vertex_words[at], vertex_words[at + 1u], vertex_words[at + 2u]);
}

// Shares of the corners at a place of this triangle.
vec3 corner_shares(vec3 place) {
  if (has_vertices == 0) return vec3(1.0 / 3.0);
  vec3 p0 = corner_position(0u);
  vec3 e1 = corner_position(1u) - p0, e2 = corner_position(2u) - p0, d = place - p0;
  float a = dot(e1, e1), b = dot(e1, e2), c = dot(e2, e2), u = dot(d, e1), v = dot(d, e2);
  float area = a * c - b * b;
  float inverse = abs(area) > 1e-30 ? 1.0 / area : 0.0;
  vec2 share = clamp(vec2(c * u - b * v, a * v - b * u) * inverse, 0.0, 1.0);
  share /= max(share.x + share.y, 1.0);
  return vec3(1.0 - share.x - share.y, share);
}

void read_tone(uint instance, vec3 place, out vec3 linear, out vec4 mask) {
  vec3 share = corner_shares(place);
  uint at = tone_shift[instance] + 3u * uint(gl_PrimitiveID);
  linear = vec3(0.0);
  mask = vec4(0.0);
  for (uint k = 0u; k < 3u; ++k) {
    uint word = tones[at + k];
    vec3 root = vec3(uvec3(word, word >> 7, word >> 14) & uvec3(127u, 127u, 63u)) / vec3(127.0, 127.0, 63.0);
    linear += share[k] * (root * root);
    mask += share[k] * (vec4(uvec4(word >> 20, word >> 23, word >> 26, word >> 29) & 7u) * (1.0 / 7.0));
  }
}
)";

// Shadows of figures on walls: mirrors element/figure_shadow.hpp.
constexpr char kSurfaceShadow[] = R"(
layout(std430, binding = 11) readonly buffer Figures { uint figures[]; };  // of cells, then the next of each
layout(location = 1) uniform float figures_top;  // relative; below everything: nobody throws any

float figure_shadow(vec2 toward, float rise, vec4 feet, vec3 p) {
  vec2 d = feet.xy - p.xy;
  float gap_m = dot(d, toward);
  float aside_m = abs(d.y * toward.x - d.x * toward.y);
  float per_meter = 1.75 / feet.w;
  if (aside_m >= 0.6 || gap_m >= 6.0 || gap_m * per_meter <= -0.25) return 0.0;
  float gap = max(gap_m, 0.0);
  float x = aside_m * per_meter;
  float z = (p.z - feet.z + gap * rise) * per_meter;
  if (z >= 2.2 || z <= -0.3) return 0.0;
  float legs = length(vec2(x - 0.09, z - clamp(z, 0.05, 0.80))) - 0.085;
  float trunk = length(vec2(x, z - clamp(z, 0.86, 1.24))) - 0.19;
  float head = length(vec2(x, z - clamp(z, 1.61, 1.64))) - 0.105;
  float soft = 0.05 + 0.08 * gap;
  float covered = clamp(0.5 - min(min(legs, trunk), head) / soft, 0.0, 1.0);
  float fade = clamp(1.0 + gap_m * per_meter * 4.0, 0.0, 1.0) * clamp(6.0 - gap, 0.0, 1.0);
  return covered * fade * (0.56 - 0.14 * clamp(z / 1.75, 0.0, 1.0));
}

float surface_shadow(vec3 p, vec3 n) {
  vec3 sun = frame.sun_direction.xyz;
  bool is_floor = abs(p.z - frame.sun_direction.w) < kFloor && n.z > 0.7;
  float facing = min(dot(n, sun) * 2.5, 1.0);
  float flat_length = length(sun.xy);
  if (is_floor || facing <= 0.0 || flat_length <= 1e-3) return 0.0;
  vec2 toward = sun.xy / flat_length;
  float rise = max(sun.z, 0.05) / flat_length;
  float reach = min((figures_top - p.z) / rise, 6.0);
  if (reach <= 0.0) return 0.0;
  vec2 to = p.xy + toward * reach;
  ivec2 low = ivec2(floor((min(p.xy, to) - 0.6) * 0.5)), high = ivec2(floor((max(p.xy, to) + 0.6) * 0.5));
  float strongest = 0.0;
  for (int y = low.y; y <= high.y; ++y) {
    for (int x = low.x; x <= high.x; ++x) {
      uint list = (uint(x) * 73856093u ^ uint(y) * 19349663u) & 16383u;
      for (uint i = figures[list]; i != 0xffffffffu; i = figures[16384u + i]) {
        strongest = max(strongest, figure_shadow(toward, rise, instances[i].feet, p));
      }
    }
  }
  float distance_m = frame.horizon_color.w > 0.5 ? 0.0 : length(p);
  return strongest * facing / (1.0 + distance_m * frame.ground_color.w);
}
)";

constexpr char kAgentFragment[] = R"(
in vec3 v_position;
in vec3 v_normal;
in vec3 v_uv_ao;
flat in uint v_visible;
layout(binding = 0) uniform sampler2DArray base_color;
layout(binding = 1) uniform sampler2DArray tint_mask;
layout(location = 0) out vec4 color;
void main() {
  uint textures = instances[v_visible].layer;
  vec3 place = vec3(v_uv_ao.xy, float(textures & 0x7fffffffu));
  vec4 base = vec4(0.0);
  vec4 mask = vec4(0.0);
  // all pixels of a triangle go the same way, so that a texture's derivatives are there
#ifdef TONES
  bool toned = (textures & 0x80000000u) != 0u;
  if (toned) read_tone(v_visible, v_position, base.rgb, mask);
#else
  const bool toned = false;
#endif
  if (!toned) {
    base = texture(base_color, place);
#ifdef CUTOUT
    if (base.a < 0.5) discard;
#endif
#ifdef TINT_MASK
    mask = texture(tint_mask, place);
#endif
  }
  vec3 albedo = base.rgb;
  uint channel = instances[v_visible].channel;
  if (channel != 0xffffffffu) {
    albedo = channel_color(channel, base.rgb);
  } else {
#ifdef TINT_MASK
    albedo = tinted(albedo, mask, instances[v_visible].tints);
#endif
  }
  vec3 n = normalize(v_normal);
#ifdef TWO_SIDED
  if (!gl_FrontFacing) n = -n;
#endif
  color = vec4(lit_color(albedo, n, v_position, v_uv_ao.z), frame.ray_origin.w);
#ifdef SURROUNDINGS
  vec3 face = cross(dFdx(v_position), dFdy(v_position));
  vec3 ray = frame.horizon_color.w > 0.5 ? frame.ray_direction.xyz : v_position;
  if (instances[v_visible].cast_shadow == 2.0 && dot(face, face) > 0.0) {
    face = normalize(dot(face, ray) > 0.0 ? -face : face);
    color.rgb *= 1.0 - surface_shadow(v_position, face);
  }
#endif
}
)";

// Mirrors ReliefBox of relief.hpp and DrawnBox of relief_pass.hpp.
constexpr char kImpostors[] = R"(
layout(std430, binding = 2) readonly buffer Boxes { uint boxes[]; };      // 32 words each
layout(std430, binding = 3) readonly buffer Shape { uint shape[]; };
layout(std430, binding = 4) readonly buffer Base { uint base_color[]; };
layout(std430, binding = 5) readonly buffer Regions { uint regions[]; };
struct DrawnBox {
  uint instance, box, first_joint;
  float px_per_m;
  float cosine_scale, sine_scale, scale, reserved;
};
layout(std430, binding = 6) readonly buffer Drawn { DrawnBox drawn[]; };
layout(std430, binding = 7) readonly buffer Joints { mat4 joints[]; };
)";

constexpr char kImpostorVertex[] = R"(
flat out uint v_drawn;
flat out vec4 v_row0, v_row1, v_row2;  // to the box's frame from relative
flat out vec3 v_size_px;
out vec3 v_position;

vec3 box_vector(uint at) {
  return vec3(uintBitsToFloat(boxes[at]), uintBitsToFloat(boxes[at + 1u]), uintBitsToFloat(boxes[at + 2u]));
}
vec3 turned(vec3 v, DrawnBox d) {
  return vec3(v.x * d.cosine_scale - v.y * d.sine_scale, v.x * d.sine_scale + v.y * d.cosine_scale, v.z * d.scale);
}

void main() {
  // a corner for each of 36: six faces of two triangles
  const int corners[36] = int[36](0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1,
                                  2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3);
  DrawnBox d = drawn[gl_InstanceID];
  uint at = 32u * d.box;
  mat4 joint = joints[d.first_joint + boxes[at]];
  vec3 origin = instances[d.instance].feet.xyz +
                turned(mat3(joint) * box_vector(at + 1u) + joint[3].xyz, d);
  vec3 side[3];
  for (int a = 0; a < 3; ++a) {
    vec3 own = box_vector(at + 4u + 3u * uint(a));
    v_size_px[a] = length(own) * d.px_per_m;
    side[a] = turned(mat3(joint) * own, d);
  }
  float volume = dot(side[0], cross(side[1], side[2]));
  vec3 row0 = cross(side[1], side[2]) / volume, row1 = cross(side[2], side[0]) / volume,
       row2 = cross(side[0], side[1]) / volume;
  v_row0 = vec4(row0, -dot(row0, origin));
  v_row1 = vec4(row1, -dot(row1, origin));
  v_row2 = vec4(row2, -dot(row2, origin));
  v_drawn = uint(gl_InstanceID);
  int corner = corners[gl_VertexID];
  v_position = origin + side[0] * float(corner & 1) + side[1] * float((corner >> 1) & 1) +
               side[2] * float(corner >> 2);
  gl_Position = frame.clip_from_relative * vec4(v_position, 1.0);
}
)";

constexpr char kImpostorFragment[] = R"(
flat in uint v_drawn;
flat in vec4 v_row0, v_row1, v_row2;
flat in vec3 v_size_px;
in vec3 v_position;
layout(location = 0) uniform ivec3 steps;  // linear, binary, adaptive
layout(location = 0) out vec4 color;

struct Level { uint first; ivec2 size; };

uint texel_at(Level level, vec2 uv) {
  ivec2 place = clamp(ivec2(floor(uv * vec2(level.size))), ivec2(0), level.size - 1);
  return level.first + uint(place.y * level.size.x + place.x);
}
Level coarser(Level level) {
  level.first += uint(level.size.x * level.size.y);
  level.size = max(level.size / 2, ivec2(1));
  return level;
}
bool is_finer(Level level, float texels) {
  return float(level.size.x * level.size.y) > texels && (level.size.x > 1 || level.size.y > 1);
}

void main() {
  DrawnBox d = drawn[v_drawn];
  vec2 pixel = gl_FragCoord.xy + frame.grid.zw;
  vec3 origin = frame.ray_origin.xyz + frame.ray_origin_x.xyz * pixel.x + frame.ray_origin_y.xyz * pixel.y;
  vec3 ray = frame.ray_direction.xyz + frame.ray_direction_x.xyz * pixel.x + frame.ray_direction_y.xyz * pixel.y;
  vec3 at = vec3(dot(v_row0.xyz, origin) + v_row0.w, dot(v_row1.xyz, origin) + v_row1.w,
                 dot(v_row2.xyz, origin) + v_row2.w);
  vec3 along = vec3(dot(v_row0.xyz, ray), dot(v_row1.xyz, ray), dot(v_row2.xyz, ray));
  along = mix(along, vec3(1e-9), lessThan(abs(along), vec3(1e-9)));
  vec3 t0 = -at / along, t1 = (1.0 - at) / along;
  vec3 from = min(t0, t1), to = max(t0, t1);
  float t_in = max(from.x, max(from.y, from.z)), t_out = min(to.x, min(to.y, to.z));
  // of the two faces that a ray meets the far one draws, so that an eye within the box sees it
  float t_here = dot(v_position - origin, ray) / dot(ray, ray);
  if (t_in >= t_out || abs(t_here - t_in) < abs(t_here - t_out)) discard;
  int axis = from.x >= from.y ? (from.x >= from.z ? 0 : 2) : (from.y >= from.z ? 1 : 2);
  if (frame.horizon_color.w < 0.5) t_in = max(t_in, 1e-3);
  bool is_far = along[axis] < 0.0;
  int u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
  uint face = 32u * d.box + 13u + 2u * uint(2 * axis + (is_far ? 1 : 0));
  float area_px = max(v_size_px[u_axis] * v_size_px[v_axis], 1e-6);
  Level level = Level(boxes[face], ivec2(boxes[face + 1u] & 0xffffu, boxes[face + 1u] >> 16));
  while (is_finer(level, 12.0 * area_px)) level = coarser(level);

  int linear = steps.x, binary = steps.y;
  bool adaptive = steps.z != 0;
  if (adaptive) {
    float most_px = max(v_size_px.x, max(v_size_px.y, v_size_px.z));
    linear = clamp(int(most_px * 0.67) + 2, 2, linear);
    float step_px = most_px / float(linear);
    int halves = 1;
    for (; halves < binary && step_px > 0.25; ++halves) step_px *= 0.5;
    binary = min(halves, binary);
  }
  vec2 uv0 = vec2(at[u_axis], at[v_axis]), uv_along = vec2(along[u_axis], along[v_axis]);
  float s0 = 255.0 * (is_far ? 1.0 - at[axis] : at[axis]);
  float s_along = 255.0 * (is_far ? -along[axis] : along[axis]);

  // a linear search for a place between front and back depth, then a binary one
  float size = (t_out - t_in) / float(linear);
  float t = t_in - 0.5 * size;
  bool found = false, before = false;
  for (int i = 0; i < linear && !found; ++i) {
    t += size;
    uint word = shape[texel_at(level, uv0 + uv_along * t)];
    float s = s0 + s_along * t, front = float(word & 255u), back = float((word >> 8) & 255u);
    bool behind = front < back && s >= front;
    found = behind && (s <= back || (adaptive && before));
    before = front < back && s < front;
  }
  if (!found) discard;
  float low = max(t - size, t_in), high = t;
  for (int i = 0; i < binary; ++i) {
    float middle = 0.5 * (low + high);
    uint word = shape[texel_at(level, uv0 + uv_along * middle)];
    float s = s0 + s_along * middle, front = float(word & 255u), back = float((word >> 8) & 255u);
    bool inside = front < back && s >= front && (adaptive || s <= back);
    if (inside) high = middle; else low = middle;
  }

  vec3 position = origin + ray * high;
  vec4 clip = frame.clip_from_relative * vec4(position, 1.0);
  gl_FragDepth = clamp(clip.z / clip.w, 0.0, 1.0);

  // colour and normal of a coarser level where that shows something
  uint texel = texel_at(level, uv0 + uv_along * high);
  if (is_finer(level, 3.0 * area_px)) {
    uint other = texel_at(coarser(level), uv0 + uv_along * high);
    if ((shape[other] & 255u) < ((shape[other] >> 8) & 255u)) texel = other;
  }
  vec2 octahedral = vec2(bitfieldExtract(int(shape[texel]), 16, 8), bitfieldExtract(int(shape[texel]), 24, 8)) / 127.0;
  vec3 n = vec3(octahedral, 1.0 - abs(octahedral.x) - abs(octahedral.y));
  float fold = max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -fold : fold;
  n.y += n.y >= 0.0 ? -fold : fold;
  n = mat3(joints[d.first_joint + boxes[32u * d.box]]) * n;
  n = normalize(vec3(n.x * d.cosine_scale - n.y * d.sine_scale, n.x * d.sine_scale + n.y * d.cosine_scale, n.z * d.scale));

  vec3 base = unpack_color(base_color[texel]);
  uint channel = instances[d.instance].channel;
  vec3 albedo = channel != 0xffffffffu ? channel_color(channel, base)
                                       : tinted(base, unpackUnorm4x8(regions[texel]), instances[d.instance].tints);
  float height = position.z - instances[d.instance].feet.z;
  color = vec4(lit_color(albedo, n, position, mix(0.55, 1.0, smoothstep(-0.05, 0.75, height))), frame.ray_origin.w);
}
)";

// Splats as the visibility rasterizer places them (visibility/cpu/splat.cpp): a disc of the surface
// is an ellipse on the picture, its depth a plane. One colour for each, so light falls once.
constexpr char kSplatVertex[] = R"(
layout(location = 0) in vec3 position;
layout(location = 1) in float radius_m;  // negative: without a side
layout(location = 2) in vec2 octahedral;
layout(location = 3) in uint base;
layout(location = 4) in uint regions;
layout(location = 5) in uint visible;
layout(location = 0) uniform mat3 view_from_relative;
layout(location = 3) uniform vec3 target;  // width and height in pixels, pixels of a tangent
layout(location = 4) uniform uint instance_count;
flat out vec4 v_disc;   // pixels from the top left, depth, squared radius
flat out vec3 v_slope;  // of the surface towards the eye, right and down; of depth by that
flat out vec3 v_color;

const float kLeastFacing = 0.25;

void main() {
  gl_Position = vec4(2.0, 2.0, 0.0, 1.0);  // outside
  gl_PointSize = 1.0;
  v_disc = vec4(0.0);
  v_slope = v_color = vec3(0.0);
  vec4 clip = frame.clip_from_relative * vec4(position, 1.0);
  if (!(clip.w > 0.0) || !(clip.z > 0.0) || !(clip.z <= clip.w)) return;
  vec3 n = vec3(octahedral, 1.0 - abs(octahedral.x) - abs(octahedral.y));
  float fold = max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -fold : fold;
  n.y += n.y >= 0.0 ? -fold : fold;
  n = normalize(n);
  vec3 to_eye = frame.horizon_color.w > 0.5 ? -frame.ray_direction.xyz : -position;
  float facing = dot(n, to_eye);
  bool has_side = radius_m >= 0.0;
  if (has_side && !(facing > 0.0)) return;
  float px_per_m = target.z / clip.w;
  float radius = abs(radius_m) * px_per_m;
  if (!(radius >= 0.0)) return;
  radius = max(radius, kLeastRadius);
  vec3 ndc = clip.xyz / clip.w;
  vec2 size = target.xy;
  v_disc = vec4((0.5 + 0.5 * ndc.x) * size.x, (0.5 - 0.5 * ndc.y) * size.y, min(ndc.z, 1.0), radius * radius);
  if (has_side) {
    vec3 in_view = view_from_relative * n;
    float steep = 1.0 / max(facing / length(to_eye), kLeastFacing);
    vec3 nearer = vec3(view_from_relative[0].z, view_from_relative[1].z, view_from_relative[2].z);
    mat4 m = frame.clip_from_relative;
    float dz = dot(vec3(m[0].z, m[1].z, m[2].z), nearer);
    float dw = dot(vec3(m[0].w, m[1].w, m[2].w), nearer);
    v_slope = vec3(-in_view.x * steep, in_view.y * steep,
                   (dz - v_disc.z * dw) / (clip.w * max(px_per_m, 1e-12)));
  } else {
    if (facing < 0.0) n = -n;
    if (visible == 0xffffffffu && regions > 0u) {
      float squeeze = 255.0 / float(min(regions, 255u));
      v_slope.x = sqrt(squeeze * squeeze - 1.0);
    }
  }
  // points are dropped with their centres: of one beside the picture the centre goes to its edge
  vec2 reach = 2.0 * radius / size;
  if (any(greaterThan(abs(ndc.xy), 1.0 + reach))) return;
  gl_Position = vec4(clamp(ndc.xy, vec2(-1.0), vec2(1.0)), v_disc.z, 1.0);
  gl_PointSize = 2.0 * radius + 0.0625;  // and what places are rounded by

  vec3 color = unpack_color(base);
  vec3 albedo = color;
  float feet = frame.sun_direction.w;
  if (visible < instance_count) {
    Instance instance = instances[visible];
    feet = instance.feet.z;
    albedo = instance.channel != 0xffffffffu ? channel_color(instance.channel, color)
                                             : tinted(color, unpackUnorm4x8(regions), instance.tints);
  }
  v_color = lit_color(albedo, n, position, mix(0.55, 1.0, smoothstep(-0.05, 0.75, position.z - feet)));
}
)";

constexpr char kSplatFragment[] = R"(
flat in vec4 v_disc;
flat in vec3 v_slope;
flat in vec3 v_color;
layout(location = 0) out vec4 color;
void main() {
#ifdef SAMPLES
  vec2 at = floor(gl_FragCoord.xy) + gl_SamplePosition - v_disc.xy;
#else
  vec2 at = gl_FragCoord.xy - v_disc.xy;
#endif
  float rise = dot(v_slope.xy, at);
  if (dot(at, at) + rise * rise > v_disc.w) discard;
  gl_FragDepth = clamp(v_disc.z + v_slope.z * rise, 1e-30, 1.0);
  color = vec4(v_color, frame.ray_origin.w);
}
)";

constexpr char kGround[] = R"(
// Where a place of the ground is on the picture; its depth is that of floors on it.
vec4 on_ground(vec2 place) {
  vec4 at = frame.clip_from_relative * vec4(place, frame.sun_direction.w, 1.0);
  if (frame.ray_direction.w == 0.0) return at;
  vec4 over = frame.clip_from_relative * vec4(place, frame.sun_direction.w + frame.ray_direction.w, 1.0);
  if (at.w > 0.0 && over.w > 0.0) at.z = min(over.z / over.w, 1.0) * at.w;
  return at;
}
)";

// A soft blob under the feet and a capsule stretched away from the sun. Only alpha is written: it
// holds how much of the light is missing (the largest of all shadows there, not their sum).
constexpr char kBlobVertex[] = R"(
out vec2 v_place;                 // metres along and across the shadow, from the feet
flat out vec3 v_strength;         // length in metres; of the contact, of the body
void main() {
  Instance instance = instances[gl_InstanceID];
  vec2 away = -frame.sun_direction.xy;
  float flat_length = length(away);
  away = flat_length > 1e-4 ? away / flat_length : vec2(1.0, 0.0);
  // lengths are those of a figure of 1.75 m; a low sun would draw across the whole picture
  float reach = 1.75 * min(flat_length / max(frame.sun_direction.z, 0.05), 3.0);
  float along = (gl_VertexID & 1) == 0 ? -0.55 : reach + 0.35;
  float across = (gl_VertexID & 2) == 0 ? -0.55 : 0.55;
  v_place = vec2(along, across);
  // fades with what it darkens: see haze and grazing in the background's shader
  float distance_m = frame.horizon_color.w > 0.5 ? 1e-3 : length(instance.feet.xyz);
  float seen = (1.0 - exp2(-55.0 * min(abs(frame.sun_direction.w) / distance_m, 1.0))) *
               exp2(-distance_m * frame.ground_color.w);
  v_strength = vec3(reach, seen * min(2.0 - instance.cast_shadow, 1.0),
                    seen * max(1.0 - instance.cast_shadow, 0.0));
  vec2 place = instance.feet.xy +
               (away * along + vec2(-away.y, away.x) * across) * (instance.feet.w / 1.75);
  gl_Position = on_ground(place);
}
)";

constexpr char kBlobFragment[] = R"(
in vec2 v_place;
flat in vec3 v_strength;
layout(location = 0) out vec4 color;
void main() {
  float contact = clamp(1.0 - dot(v_place, v_place) * (1.0 / (0.48 * 0.48)), 0.0, 1.0);
  contact *= contact * 0.62;
  // the further from the feet, the softer and weaker
  float along = clamp(v_place.x / max(v_strength.x, 0.01), 0.0, 1.0);
  vec2 off = vec2(v_place.x - clamp(v_place.x, 0.0, v_strength.x), v_place.y);
  float width = mix(0.20, 0.34, along);
  float body = clamp(1.0 - dot(off, off) / (width * width), 0.0, 1.0);
  body *= (2.0 - body) * mix(0.50, 0.30, along);
  color = vec4(0.0, 0.0, 0.0, max(contact * v_strength.y, body * v_strength.z));
}
)";

// The figure itself, flattened on the ground along the sun's direction.
constexpr char kCastShadowVertex[] = R"(
layout(location = 0) in vec3 position;
layout(location = 3) in uint visible;
flat out float v_share;
flat out float v_least;  // height of what throws any, metres
out vec2 v_height;       // share of the figure's, metres
void main() {
  vec4 feet = instances[visible].feet;
  float height = max(position.z - frame.sun_direction.w, 0.0);
  vec3 sun = frame.sun_direction.xyz;
  vec2 place = position.xy - sun.xy * (height / max(sun.z, 0.05));
  float distance_m = frame.horizon_color.w > 0.5 ? 1e-3 : length(feet.xyz);
  v_share = min(instances[visible].cast_shadow, 1.0) *
            (1.0 - exp2(-55.0 * min(abs(frame.sun_direction.w) / distance_m, 1.0)));
  v_height = vec2(height / max(feet.w, 0.1), height);
  v_least = instances[visible].cast_shadow == 2.0 ? kFloor : 0.0;  // floors throw none
  gl_Position = on_ground(place);
}
)";

constexpr char kCastShadowFragment[] = R"(
flat in float v_share;
flat in float v_least;
in vec2 v_height;
layout(location = 0) out vec4 color;
void main() {
  if (v_height.y < v_least) discard;
  color = vec4(0.0, 0.0, 0.0, v_share * mix(0.56, 0.42, clamp(v_height.x, 0.0, 1.0)));
}
)";

constexpr char kBackgroundVertex[] = R"(
void main() {
  vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID & 2) * 2 - 1);
  gl_Position = vec4(corner, 0.0, 1.0);  // depth 0: only where nothing was drawn
}
)";

// Takes the light that is missing from floors.
constexpr char kFloorFragment[] = R"(
layout(location = 0) out vec4 color;
void main() { color = vec4(0.0, 0.0, 0.0, 1.0); }
)";

constexpr char kBackgroundFragment[] = R"(
layout(location = 0) out vec4 color;

// Share of the interval [p - w/2, p + w/2] that lies on lines of this half width, one each `period`:
// the exact integral, so distant lines fade into their mean instead of flickering.
vec2 line_cover(vec2 p, vec2 w, float period, float half_width) {
  vec2 low = (p - 0.5 * w) / period + half_width / period;
  vec2 high = (p + 0.5 * w) / period + half_width / period;
  float share = 2.0 * half_width / period;
  vec2 sum_low = floor(low) * share + min(fract(low), share);
  vec2 sum_high = floor(high) * share + min(fract(high), share);
  return (sum_high - sum_low) * period / w;
}

vec3 sky(float up) {
  // a bright band at the horizon, deep above; below it (no ground) a dim mirror image
  float t = clamp(up, 0.0, 1.0);
  vec3 above = mix(frame.horizon_color.rgb, frame.sky_color.rgb, 1.0 - exp2(-4.5 * t));
  vec3 below = mix(frame.horizon_color.rgb, frame.ground_light.rgb, 1.0 - exp2(6.0 * min(up, 0.0)));
  return (up >= 0.0 ? above : below) * 1.12;
}

void main() {
  vec2 pixel = gl_FragCoord.xy + frame.grid.zw;
  vec3 origin = frame.ray_origin.xyz + frame.ray_origin_x.xyz * pixel.x + frame.ray_origin_y.xyz * pixel.y;
  vec3 ray = frame.ray_direction.xyz + frame.ray_direction_x.xyz * pixel.x + frame.ray_direction_y.xyz * pixel.y;
  float ray_length = length(ray);
  float up = ray.z / ray_length;
  float to_plane = frame.sun_direction.w - origin.z;
  bool orthographic = frame.horizon_color.w > 0.5;
  bool hit = frame.sky_color.w > 0.5 && (orthographic ? abs(ray.z) > 1e-5 : to_plane * ray.z > 0.0);
  if (!hit) {
    // below the ground plane's horizon there is no sky to see when the eye is under it
    color = vec4(tone_map(sky(frame.sky_color.w > 0.5 && frame.sun_color.w < 0.5 ? min(up, -0.02) : up)), 1.0);
    return;
  }
  float t = to_plane / ray.z;
  vec3 place = origin + ray * t;
  // how far the place moves with a pixel to the right and a pixel down
  float tx = -(frame.ray_origin_x.z + frame.ray_direction_x.z * t) / ray.z;
  float ty = -(frame.ray_origin_y.z + frame.ray_direction_y.z * t) / ray.z;
  vec2 step_x = frame.ray_origin_x.xy + frame.ray_direction_x.xy * t + ray.xy * tx;
  vec2 step_y = frame.ray_origin_y.xy + frame.ray_direction_y.xy * t + ray.xy * ty;
  vec2 width = max(abs(step_x) + abs(step_y), vec2(1e-5));

  vec2 p = place.xy + frame.grid.xy;
  vec2 fine = line_cover(p, width, 1.0, 0.010);
  vec2 strong = line_cover(p, width, 10.0, 0.028);
  float metre = fine.x + fine.y - fine.x * fine.y;
  float ten = strong.x + strong.y - strong.x * strong.y;

  // slabs of a metre, no two neighbours quite alike; the differences fade before they could flicker
  uvec2 slab = uvec2(mod(floor(p), 20.0));
  uint bits = (slab.x * 73u + slab.y * 179u + 11u) * 0x9e3779b1u;
  bits = (bits ^ (bits >> 15)) * 0x85ebca6bu;
  float shade = float(bits >> 16) * (1.0 / 65536.0) - 0.5;
  float apart = clamp(1.4 - 1.2 * max(width.x, width.y), 0.0, 1.0);
  vec3 albedo = frame.ground_color.rgb * (1.0 + 0.08 * shade * apart);
  albedo = mix(albedo, albedo * 0.62, metre);
  albedo = mix(albedo, albedo * 0.34, ten);
  vec3 light = frame.sun_color.rgb * max(frame.sun_direction.z, 0.0) + frame.sky_color.rgb;
  if (frame.sun_color.w < 0.5) light = frame.ground_light.rgb;  // seen from below
  float distance_m = orthographic ? 0.0 : abs(t) * ray_length;
  vec3 lit = haze(albedo * light, distance_m);
  // at grazing angles the ground goes over into the horizon
  float grazing = orthographic ? 0.0 : exp2(-abs(up) * 55.0);
  color = vec4(tone_map(mix(lit, frame.horizon_color.rgb * 1.12, grazing)), 1.0);
}
)";

std::string defines(const ShaderOptions& options) {
  std::string text;
  if (options.cutout) text += "#define CUTOUT\n";
  if (options.two_sided) text += "#define TWO_SIDED\n";
  if (options.tint_mask) text += "#define TINT_MASK\n";
  if (options.tones) text += "#define TONES\n";
  if (options.surroundings) text += "#define SURROUNDINGS\n";
  return text;
}

}  // namespace

std::string agent_vertex_shader(const ShaderOptions&) {
  return std::string(kCommon) + kInstances + kAgentVertex;
}
std::string agent_fragment_shader(const ShaderOptions& options) {
  return std::string(kCommon) + defines(options) + kInstances + kLight +
         (options.tones ? kTones : "") + (options.surroundings ? kSurfaceShadow : "") +
         kAgentFragment;
}
std::string impostor_vertex_shader() {
  return std::string(kCommon) + kInstances + kImpostors + kImpostorVertex;
}
std::string impostor_fragment_shader() {
  return std::string(kCommon) + kInstances + kLight + kImpostors + kImpostorFragment;
}
std::string splat_vertex_shader(int samples) {
  // far ones still meet a sample now and then
  const char* least =
      samples > 1 ? "const float kLeastRadius = 0.25;\n" : "const float kLeastRadius = 0.5;\n";
  return std::string(kCommon) + kInstances + kLight + least + kSplatVertex;
}
std::string splat_fragment_shader(int samples) {
  return std::string(kCommon) + (samples > 1 ? "#define SAMPLES\n" : "") + kSplatFragment;
}
std::string blob_vertex_shader() {
  return std::string(kCommon) + kInstances + kGround + kBlobVertex;
}
std::string blob_fragment_shader() { return std::string(kCommon) + kBlobFragment; }
std::string cast_shadow_vertex_shader() {
  return std::string(kCommon) + kInstances + kGround + kCastShadowVertex;
}
std::string cast_shadow_fragment_shader() { return std::string(kCommon) + kCastShadowFragment; }
std::string floor_fragment_shader() { return std::string(kCommon) + kFloorFragment; }
std::string background_vertex_shader() { return std::string(kCommon) + kBackgroundVertex; }
std::string background_fragment_shader() { return std::string(kCommon) + kBackgroundFragment; }

}  // namespace throng::render::gl
