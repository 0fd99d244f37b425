#include "simplify/report/studio.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "throng/render/srgb.hpp"

namespace throng::simplify {
namespace {

constexpr double kEyeDistance = 64.0;  // metres, with figures scaled to one height
constexpr float kStandingHeightM = 1.75F;
constexpr float kQuarterTurnRad = 1.5707963F;

const std::array<float, 256>& linear_table() {
  static const auto table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i) values[i] = linear_from_byte(static_cast<std::uint8_t>(i));
    return values;
  }();
  return table;
}

/// sRGB byte of a linear value in 4096 steps.
const std::array<std::uint8_t, 4097>& byte_table() {
  static const auto table = [] {
    std::array<std::uint8_t, 4097> values{};
    for (int i = 0; i <= 4096; ++i) values[i] = byte_from_linear(static_cast<float>(i) / 4096.0F);
    return values;
  }();
  return table;
}

/// The character's faces are turned from +X to the viewer, who looks along +Y.
glm::vec3 turned(const glm::vec3& v, float cosine, float sine) {
  return {cosine * v.x - sine * v.y, sine * v.x + cosine * v.y, v.z};
}

}  // namespace

float linear_from_byte(std::uint8_t byte) {
  return render::srgb_to_linear(static_cast<float>(byte) / 255.0F);
}

std::uint8_t byte_from_linear(float c) {
  return static_cast<std::uint8_t>(glm::clamp(render::linear_to_srgb(c), 0.0F, 1.0F) * 255.0F +
                                   0.5F);
}

std::uint32_t seed_of(std::string_view name) {
  std::uint32_t hash = 2166136261U;
  for (const char c : name) hash = (hash ^ static_cast<std::uint8_t>(c)) * 16777619U;
  return hash;
}

Frame frame_of(const PosedVertices& posed, float turn_rad, float elevation_rad) {
  const float c = std::cos(turn_rad - kQuarterTurnRad), s = std::sin(turn_rad - kQuarterTurnRad);
  const float up_y = std::sin(elevation_rad), up_z = std::cos(elevation_rad);
  Frame frame{glm::vec2(std::numeric_limits<float>::max()),
              glm::vec2(std::numeric_limits<float>::lowest())};
  for (const glm::vec3& p : posed.position) {
    const glm::vec3 q = turned(p, c, s);
    const glm::vec2 at(q.x, -(up_y * q.y + up_z * q.z));
    frame.low = glm::min(frame.low, at);
    frame.high = glm::max(frame.high, at);
  }
  return frame;
}

absl::StatusOr<std::unique_ptr<Studio>> Studio::make(const render::Character& character,
                                                     std::uint32_t seed) {
  std::unique_ptr<Studio> studio(new Studio);
  auto rasterizer = render::make_rasterizer(render::RasterKind::kVisibility, 1);
  if (!rasterizer.ok()) return rasterizer.status();
  studio->rasterizer_ = *std::move(rasterizer);
  studio->character_ = character;
  studio->seed_ = seed;
  for (const std::uint8_t flags : character.triangle_flags)
    studio->has_cutout_ |= (flags & render::kTriangleAlphaCutout) != 0;
  studio->flags_.assign(character.triangle_flags.begin(), character.triangle_flags.end());
  auto cast = std::make_shared<render::Cast>();
  cast->members.push_back({character, 1.0F});
  if (auto status = studio->rasterizer_->upload(std::move(cast)); !status.ok()) return status;
  return studio;
}

/// Holes are looked up by a triangle's place in the mesh; another mesh's order needs its own flags.
absl::Status Studio::use_flags(const LevelMesh& mesh) {
  const bool is_prefix =
      mesh.triangle_flags.size() <= flags_.size() &&
      std::equal(mesh.triangle_flags.begin(), mesh.triangle_flags.end(), flags_.begin());
  if (!has_cutout_ || is_prefix) return absl::OkStatus();
  flags_ = mesh.triangle_flags;
  auto cast = std::make_shared<render::Cast>();
  cast->members.push_back({character_, 1.0F});
  cast->members[0].character.triangle_flags = flags_;
  return rasterizer_->upload(std::move(cast));
}

absl::Status Studio::draw_lit(const LevelMesh& mesh, std::span<const Figure> figures,
                              const Shot& shot, const render::Look& look,
                              render::Picture& picture) {
  if (auto status = use_flags(mesh); !status.ok()) return status;
  // giants and gnomes get a person's height, so that depths and lights are the same for all
  const float scale = kStandingHeightM / character_.height_m;
  const float px_per_unit = shot.px_per_m / scale;
  const glm::vec3 up(0.0F, std::sin(shot.elevation_rad), std::cos(shot.elevation_rad));
  const auto eye = glm::vec3(
      kEyeDistance * glm::dvec3(0.0, -std::cos(shot.elevation_rad), std::sin(shot.elevation_rad)));
  std::vector<std::uint32_t> used, new_index(character_.vertex_count(), ~0U);
  for (const glm::uvec3& corner : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      if (new_index[corner[k]] != ~0U) continue;
      new_index[corner[k]] = static_cast<std::uint32_t>(used.size());
      used.push_back(corner[k]);
    }
  }
  instances_.clear();
  vertices_.clear();
  indices_.clear();
  vertex_offset_.assign(1, 0);
  triangle_offset_.assign(1, 0);
  for (const Figure& figure : figures) {
    const glm::vec2 place =
        (figure.origin_px - 0.5F * glm::vec2(shot.width_px, shot.height_px)) / px_per_unit;
    const glm::vec3 origin = glm::vec3(place.x, 0.0F, 0.0F) - place.y * up - eye;
    const float c = std::cos(figure.turn_rad - kQuarterTurnRad);
    const float s = std::sin(figure.turn_rad - kQuarterTurnRad);
    const auto first = static_cast<std::uint32_t>(vertices_.size());
    for (const std::uint32_t v : used) {
      render::BatchVertex vertex{};
      vertex.position_relative = origin + scale * turned(figure.posed->position[v], c, s);
      vertex.normal = render::encode_octahedral(turned(figure.posed->normal[v], c, s));
      vertex.uv = character_.uv[v];
      vertex.visible = static_cast<std::uint32_t>(instances_.size());
      vertices_.push_back(vertex);
    }
    for (const glm::uvec3& corner : mesh.triangles) {
      for (int k = 0; k < 3; ++k) indices_.push_back(first + new_index[corner[k]]);
    }
    render::VisibleInstance instance{};
    instance.position_relative = origin;
    instance.heading_rad = figure.turn_rad - kQuarterTurnRad;
    instance.slot = static_cast<std::uint32_t>(instances_.size());
    instance.seed = seed_;
    instance.scale = scale;
    instance.channel = std::numeric_limits<float>::quiet_NaN();
    instance.radius_m = scale * character_.bounds.w;
    // a mesh that is no level of the character has texture, however few vertices it has
    instance.vertex_count = mesh.count > 0 ? mesh.count : character_.vertex_count() + 1;
    instance.triangle_count = static_cast<std::uint32_t>(mesh.triangles.size());
    instances_.push_back(instance);
    vertex_offset_.push_back(static_cast<std::uint32_t>(vertices_.size()));
    triangle_offset_.push_back(static_cast<std::uint32_t>(indices_.size() / 3));
  }
  render::FrameGeometry geometry;
  geometry.instances = instances_;
  geometry.vertex_offset = vertex_offset_;
  geometry.triangle_offset = triangle_offset_;
  geometry.vertices = vertices_;
  geometry.indices = indices_;
  render::Camera camera;
  camera.eye_world = eye;
  camera.target_world = glm::dvec3(0.0);
  camera.ortho_height_m = static_cast<double>(shot.height_px) / px_per_unit;
  camera.near_m = 0.1;
  camera.far_m = 2.0 * kEyeDistance;
  return rasterizer_->draw(geometry, camera, {shot.width_px, shot.height_px}, glm::dvec3(0.0), look,
                           picture);
}

absl::Status Studio::draw(const LevelMesh& mesh, std::span<const Figure> figures, const Shot& shot,
                          render::Picture& picture) {
  render::Look look;
  look.ground = look.shadows = false;
  look.horizon_color = look.ground_light = glm::vec3(0.42F);
  look.sun_direction_world = {-0.45F, -0.75F, 0.70F};  // over the viewer's left shoulder
  return draw_lit(mesh, figures, shot, look, picture);
}

absl::Status Studio::cover(const LevelMesh& mesh, std::span<const Figure> figures, const Shot& shot,
                           std::vector<std::uint8_t>& samples) {
  // black figures in front of white
  render::Look look;
  look.ground = look.shadows = false;
  look.sun_color = look.sky_color = look.ground_light = glm::vec3(0.0F);
  look.horizon_color = glm::vec3(1.0F);
  if (auto status = draw_lit(mesh, figures, shot, look, scratch_); !status.ok()) return status;
  // the background is one colour, darker the more it is seen from above; the corner is never
  // covered
  const float white = linear_table()[scratch_.rgbx[0]];
  std::array<std::uint8_t, 256> covered{};
  for (int i = 0; i < 256; ++i) {
    const float share = 1.0F - std::min(linear_table()[i] / std::max(white, 1.0e-6F), 1.0F);
    covered[i] = static_cast<std::uint8_t>(4.0F * share + 0.5F);
  }
  samples.resize(scratch_.rgbx.size() / 4);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = covered[scratch_.rgbx[4 * i]];
  return absl::OkStatus();
}

absl::StatusOr<Cutout> Studio::cut_out(const LevelMesh& mesh, const Figure& figure,
                                       const Shot& shot) {
  render::Picture picture;
  std::vector<std::uint8_t> samples;
  if (auto status = draw(mesh, {&figure, 1}, shot, picture); !status.ok()) return status;
  if (auto status = cover(mesh, {&figure, 1}, shot, samples); !status.ok()) return status;
  const std::array<float, 256>& linear = linear_table();
  const glm::vec3 background(linear[picture.rgbx[0]], linear[picture.rgbx[1]],
                             linear[picture.rgbx[2]]);
  Cutout cutout{shot.width_px / 2, shot.height_px / 2, {}};
  cutout.pixels.resize(std::size_t{cutout.width_px} * cutout.height_px, glm::vec4(0.0F));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i] == 0) continue;
    const std::size_t x = i % shot.width_px / 2, y = i / shot.width_px / 2;
    const float share = static_cast<float>(samples[i]) / 4.0F;
    const std::uint8_t* pixel = picture.rgbx.data() + 4 * i;
    const glm::vec3 color(linear[pixel[0]], linear[pixel[1]], linear[pixel[2]]);
    cutout.pixels[y * cutout.width_px + x] +=
        0.25F * glm::vec4(glm::max(color - (1.0F - share) * background, glm::vec3(0.0F)), share);
  }
  return cutout;
}

render::Picture halved(const render::Picture& picture) {
  render::Picture half;
  half.width_px = picture.width_px / 2;
  half.height_px = picture.height_px / 2;
  half.rgbx.resize(std::size_t{4} * half.width_px * half.height_px, 255);
  const std::array<float, 256>& linear = linear_table();
  const std::array<std::uint8_t, 4097>& bytes = byte_table();
  const std::size_t row = std::size_t{4} * picture.width_px;
  for (std::size_t y = 0; y < half.height_px; ++y) {
    const std::uint8_t* in = picture.rgbx.data() + 2 * y * row;
    std::uint8_t* out = half.rgbx.data() + std::size_t{4} * y * half.width_px;
    for (std::size_t x = 0; x < half.width_px; ++x, in += 8, out += 4) {
      for (int c = 0; c < 3; ++c) {
        const float sum =
            linear[in[c]] + linear[in[c + 4]] + linear[in[row + c]] + linear[in[row + c + 4]];
        out[c] = bytes[static_cast<std::size_t>(sum * 1024.0F + 0.5F)];
      }
    }
  }
  return half;
}

}  // namespace throng::simplify
