#include "bench/experiments/instancing.hpp"

#include <absl/strings/str_cat.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "bench/experiments/discrete.hpp"
#include "render/raster/gl/cast_textures.hpp"
#include "render/raster/gl/egl_context.hpp"
#include "render/raster/gl/program.hpp"

namespace throng::bench {
namespace {

using render::Cast;
using render::Character;

constexpr char kVertexShader[] = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 octahedral;
layout(location = 2) in vec2 uv;
layout(location = 3) in uvec4 joint;
layout(location = 4) in vec4 weight;
layout(location = 5) in vec3 feet;         // of the agent, relative to the eye
layout(location = 6) in vec3 placement;    // scale times cosine and sine of the heading, scale
layout(location = 7) in uvec4 agent;       // character, level, first joint of its frame
layout(location = 0) uniform mat4 clip_from_relative;
layout(std430, binding = 0) readonly buffer Palette { vec4 rows[]; };
out vec3 v_normal;
out vec3 v_uv_layer;
void main() {
  vec4 row0 = vec4(0.0), row1 = vec4(0.0), row2 = vec4(0.0);
  for (int i = 0; i < 4; ++i) {
    uint first = 3u * (agent.z + joint[i]);
    row0 += weight[i] * rows[first];
    row1 += weight[i] * rows[first + 1u];
    row2 += weight[i] * rows[first + 2u];
  }
  vec3 n = vec3(octahedral, 1.0 - abs(octahedral.x) - abs(octahedral.y));
  float fold = max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -fold : fold;
  n.y += n.y >= 0.0 ? -fold : fold;
  vec4 p = vec4(position, 1.0);
  vec3 posed = vec3(dot(row0, p), dot(row1, p), dot(row2, p));
  vec3 turned = vec3(dot(row0.xyz, n), dot(row1.xyz, n), dot(row2.xyz, n));
  v_normal = vec3(turned.x * placement.x - turned.y * placement.y,
                  turned.x * placement.y + turned.y * placement.x, turned.z * placement.z);
  v_uv_layer = vec3(uv, float(agent.x));
  vec3 world = feet + vec3(posed.x * placement.x - posed.y * placement.y,
                           posed.x * placement.y + posed.y * placement.x, posed.z * placement.z);
  gl_Position = clip_from_relative * vec4(world, 1.0);
}
)";

constexpr char kFragmentShader[] = R"(#version 450 core
in vec3 v_normal;
in vec3 v_uv_layer;
layout(binding = 0) uniform sampler2DArray base_color;
layout(location = 0) out vec4 color;
void main() {
  const vec3 sun = vec3(0.4508, -0.5509, 0.7012);
  float light = 0.35 + 0.65 * max(dot(normalize(v_normal), sun), 0.0);
  color = vec4(texture(base_color, v_uv_layer).rgb * light, 1.0);
}
)";

struct StaticVertex {
  glm::vec3 position;
  glm::i16vec2 normal;
  glm::u16vec2 uv;
  glm::u8vec4 joint, weight;
};
static_assert(sizeof(StaticVertex) == 28);
static_assert(sizeof(InstancedAgent) == 36);

/// What one call draws of a character.
struct LevelRange {
  std::uint32_t first_index = 0, index_count = 0;
};

absl::Status failed(const char* call) {
  const GLenum code = glGetError();
  if (code == GL_NO_ERROR) return absl::OkStatus();
  while (glGetError() != GL_NO_ERROR) {
  }
  const std::string message = absl::StrCat("instancing: ", call, ": GL error 0x", absl::Hex(code));
  return code == GL_OUT_OF_MEMORY ? absl::ResourceExhaustedError(message)
                                  : absl::InternalError(message);
}

class GlInstancing final : public Instancing {
 public:
  explicit GlInstancing(std::unique_ptr<render::gl::EglContext> context)
      : context_(std::move(context)) {}

  ~GlInstancing() override {
    render::gl::BoundContext bound(*context_);
    if (!bound.status().ok()) return;
    glDeleteProgram(program_);
    glDeleteVertexArrays(1, &array_);
    glDeleteTextures(1, &texture_);
    const GLuint buffers[] = {vertices_, indices_, palette_, agents_};
    glDeleteBuffers(4, buffers);
    release_target();
  }

  std::string device() const override { return context_->renderer(); }

  absl::Status prepare(const Cast& cast) {
    render::gl::BoundContext bound(*context_);
    if (!bound.status().ok()) return bound.status();
    auto program = render::gl::make_program("instancing", kVertexShader, kFragmentShader);
    if (!program.ok()) return program.status();
    program_ = *program;

    std::vector<StaticVertex> vertices;
    std::vector<std::uint32_t> indices;
    std::vector<render::Affine> palette;
    std::vector<const render::MipImage*> images;
    for (const render::CastMember& member : cast.members) {
      const Character& c = member.character;
      first_vertex_.push_back(static_cast<GLint>(vertices.size()));
      first_joint_.push_back(static_cast<std::uint32_t>(palette.size()));
      palette.insert(palette.end(), c.palette.begin(), c.palette.end());
      images.push_back(&c.base_color);
      for (std::size_t i = 0; i < c.position.size(); ++i) {
        vertices.push_back(
            {c.position[i], c.normal[i], c.uv[i], c.joint_index[i], c.joint_weight[i]});
      }
      for (std::uint32_t level = 0; level < kDiscreteLevels; ++level) {
        const std::uint32_t n = discrete_vertex_count(c, level);
        LevelRange range{static_cast<std::uint32_t>(indices.size()), 3 * c.triangle_count_at[n]};
        for (std::uint32_t t = 0; t < c.triangle_count_at[n]; ++t) {
          for (int k = 0; k < 3; ++k) {
            std::uint32_t corner = c.triangle[t][k];
            while (corner >= n) corner = c.collapse_target[corner];
            indices.push_back(corner);
          }
        }
        levels_.push_back(range);
      }
    }
    const auto buffer = [](const auto& data) {
      GLuint name = 0;
      glCreateBuffers(1, &name);
      glNamedBufferStorage(name, static_cast<GLsizeiptr>(data.size() * sizeof(data[0])),
                           data.data(), 0);
      return name;
    };
    vertices_ = buffer(vertices);
    indices_ = buffer(indices);
    palette_ = buffer(palette);

    auto layers = render::gl::make_texture_layers(images, true, 0xb4b4b4ffU, 4096);
    if (!layers.ok()) return layers.status();
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture_);
    glTextureStorage3D(texture_, static_cast<GLsizei>(layers->level_count), GL_SRGB8_ALPHA8,
                       static_cast<GLsizei>(layers->width_px),
                       static_cast<GLsizei>(layers->height_px),
                       static_cast<GLsizei>(layers->layer_count));
    for (std::uint32_t level = 0; level < layers->level_count; ++level) {
      glTextureSubImage3D(texture_, static_cast<GLint>(level), 0, 0, 0,
                          static_cast<GLsizei>(std::max(1U, layers->width_px >> level)),
                          static_cast<GLsizei>(std::max(1U, layers->height_px >> level)),
                          static_cast<GLsizei>(layers->layer_count), GL_RGBA, GL_UNSIGNED_BYTE,
                          layers->levels[level].data());
    }
    glTextureParameteri(texture_, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);

    glCreateVertexArrays(1, &array_);
    const auto attribute = [this](GLuint at, GLuint binding) {
      glEnableVertexArrayAttrib(array_, at);
      glVertexArrayAttribBinding(array_, at, binding);
    };
    for (GLuint at = 0; at < 5; ++at) attribute(at, 0);
    for (GLuint at = 5; at < 8; ++at) attribute(at, 1);
    glVertexArrayAttribFormat(array_, 0, 3, GL_FLOAT, GL_FALSE, offsetof(StaticVertex, position));
    glVertexArrayAttribFormat(array_, 1, 2, GL_SHORT, GL_TRUE, offsetof(StaticVertex, normal));
    glVertexArrayAttribFormat(array_, 2, 2, GL_UNSIGNED_SHORT, GL_TRUE, offsetof(StaticVertex, uv));
    glVertexArrayAttribIFormat(array_, 3, 4, GL_UNSIGNED_BYTE, offsetof(StaticVertex, joint));
    glVertexArrayAttribFormat(array_, 4, 4, GL_UNSIGNED_BYTE, GL_TRUE,
                              offsetof(StaticVertex, weight));
    glVertexArrayAttribFormat(array_, 5, 3, GL_FLOAT, GL_FALSE,
                              offsetof(InstancedAgent, position_relative));
    glVertexArrayAttribFormat(array_, 6, 3, GL_FLOAT, GL_FALSE,
                              offsetof(InstancedAgent, cosine_scale));
    glVertexArrayAttribIFormat(array_, 7, 3, GL_UNSIGNED_INT, offsetof(InstancedAgent, character));
    glVertexArrayBindingDivisor(array_, 1, 1);
    glVertexArrayVertexBuffer(array_, 0, vertices_, 0, sizeof(StaticVertex));
    glVertexArrayElementBuffer(array_, indices_);

    glClipControl(GL_UPPER_LEFT, GL_ZERO_TO_ONE);
    glEnable(GL_FRAMEBUFFER_SRGB);
    glEnable(GL_DEPTH_TEST);
    glEnable(GL_CULL_FACE);
    glDisable(GL_DITHER);
    glDepthFunc(GL_GREATER);
    return failed("prepare");
  }

  std::uint32_t triangles(std::uint32_t character, std::uint32_t level) const override {
    return levels_[character * kDiscreteLevels + level].index_count / 3;
  }

  absl::Status draw(std::span<const InstancedAgent> agents, const render::Camera& camera,
                    const render::Viewport& viewport, render::Picture& picture) override {
    render::gl::BoundContext bound(*context_);
    if (!bound.status().ok()) return bound.status();
    const auto width = static_cast<GLsizei>(viewport.width_px);
    const auto height = static_cast<GLsizei>(viewport.height_px);
    if (absl::Status status = use_target(viewport); !status.ok()) return status;

    // counting sort: one call for each character and level
    std::vector<std::uint32_t> first(levels_.size() + 1, 0);
    const auto group = [](const InstancedAgent& a) {
      return a.character * kDiscreteLevels + a.level;
    };
    for (const InstancedAgent& agent : agents) ++first[group(agent) + 1];
    for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    sorted_.resize(agents.size());
    std::vector<std::uint32_t> next = first;
    for (const InstancedAgent& agent : agents) {
      InstancedAgent& placed = sorted_[next[group(agent)]++] = agent;
      placed.first_joint += first_joint_[agent.character];
    }
    if (agents.size() > agents_capacity_) {
      glDeleteBuffers(1, &agents_);
      glCreateBuffers(1, &agents_);
      glNamedBufferStorage(agents_, static_cast<GLsizeiptr>(agents.size_bytes()), nullptr,
                           GL_DYNAMIC_STORAGE_BIT);
      agents_capacity_ = agents.size();
      glVertexArrayVertexBuffer(array_, 1, agents_, 0, sizeof(InstancedAgent));
    }
    if (!sorted_.empty()) {
      glNamedBufferSubData(agents_, 0, static_cast<GLsizeiptr>(agents.size_bytes()),
                           sorted_.data());
    }

    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    glViewport(0, 0, width, height);
    const GLfloat sky[4] = {0.63F, 0.69F, 0.78F, 1.0F}, far_depth = 0.0F;
    glClearNamedFramebufferfv(framebuffer_, GL_COLOR, 0, sky);
    glClearNamedFramebufferfv(framebuffer_, GL_DEPTH, 0, &far_depth);
    glUseProgram(program_);
    const glm::mat4 clip = render::clip_from_relative(camera, viewport);
    glUniformMatrix4fv(0, 1, GL_FALSE, &clip[0][0]);
    glBindTextureUnit(0, texture_);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, palette_);
    glBindVertexArray(array_);
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      const std::uint32_t count = first[i + 1] - first[i];
      if (count == 0) continue;
      glDrawElementsInstancedBaseVertexBaseInstance(
          GL_TRIANGLES, static_cast<GLsizei>(levels_[i].index_count), GL_UNSIGNED_INT,
          reinterpret_cast<const void*>(std::uintptr_t{4} * levels_[i].first_index),
          static_cast<GLsizei>(count), first_vertex_[i / kDiscreteLevels], first[i]);
    }
    picture.width_px = viewport.width_px;
    picture.height_px = viewport.height_px;
    picture.rgbx.resize(std::size_t{4} * viewport.width_px * viewport.height_px);
    glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, picture.rgbx.data());
    return failed("draw");
  }

 private:
  void release_target() {
    glDeleteFramebuffers(1, &framebuffer_);
    const GLuint buffers[] = {color_, depth_};
    glDeleteRenderbuffers(2, buffers);
    framebuffer_ = 0;
  }

  absl::Status use_target(const render::Viewport& viewport) {
    if (framebuffer_ != 0 && viewport.width_px == target_.width_px &&
        viewport.height_px == target_.height_px) {
      return absl::OkStatus();
    }
    release_target();
    const auto width = static_cast<GLsizei>(viewport.width_px);
    const auto height = static_cast<GLsizei>(viewport.height_px);
    glCreateFramebuffers(1, &framebuffer_);
    glCreateRenderbuffers(1, &color_);
    glCreateRenderbuffers(1, &depth_);
    glNamedRenderbufferStorage(color_, GL_SRGB8_ALPHA8, width, height);
    glNamedRenderbufferStorage(depth_, GL_DEPTH_COMPONENT32F, width, height);
    glNamedFramebufferRenderbuffer(framebuffer_, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_);
    glNamedFramebufferRenderbuffer(framebuffer_, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_);
    target_ = viewport;
    return failed("framebuffer");
  }

  std::unique_ptr<render::gl::EglContext> context_;
  GLuint program_ = 0, array_ = 0, texture_ = 0;
  GLuint vertices_ = 0, indices_ = 0, palette_ = 0, agents_ = 0;
  GLuint framebuffer_ = 0, color_ = 0, depth_ = 0;
  render::Viewport target_;
  std::size_t agents_capacity_ = 0;
  std::vector<GLint> first_vertex_;         // by character
  std::vector<std::uint32_t> first_joint_;  // by character, in affine matrices
  std::vector<LevelRange> levels_;          // [character][level]
  std::vector<InstancedAgent> sorted_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Instancing>> Instancing::make(std::shared_ptr<const Cast> cast) {
  auto context = render::gl::EglContext::make();
  if (!context.ok()) return context.status();
  auto instancing = std::make_unique<GlInstancing>(*std::move(context));
  if (absl::Status status = instancing->prepare(*cast); !status.ok()) return status;
  return instancing;
}

std::vector<InstancedAgent> instanced_agents(const render::Snapshot& snapshot, const Cast& cast,
                                             const render::Camera& camera,
                                             const render::Viewport& viewport, bool discrete) {
  const double focal_px = 0.5 * viewport.height_px / std::tan(0.5 * camera.fov_y_rad);
  std::vector<InstancedAgent> agents;
  agents.reserve(snapshot.present_count);
  for (std::size_t i = 0; i < snapshot.present.size(); ++i) {
    if (snapshot.present[i] == 0) continue;
    InstancedAgent agent{};
    agent.character = snapshot.roster->character[i];
    const Character& character = cast.members[agent.character].character;
    agent.position_relative = glm::vec3(glm::dvec3(snapshot.position_m[i]) - camera.eye_world);
    agent.scale = snapshot.roster->scale[i];
    const float heading_rad = std::isnan(snapshot.heading_rad[i]) ? 0.0F : snapshot.heading_rad[i];
    agent.cosine_scale = agent.scale * std::cos(heading_rad);
    agent.sine_scale = agent.scale * std::sin(heading_rad);
    if (discrete) {
      const double distance_m = std::max(0.1F, glm::length(agent.position_relative));
      agent.level = discrete_level(focal_px * character.height_m * agent.scale / distance_m);
    }
    // the frame of the clip that the agent's speed asks for
    const render::ClipKind kind =
        snapshot.speed_mps[i] > 0.3F ? render::ClipKind::kWalk : render::ClipKind::kIdle;
    const render::Clip* clip = &character.clips.front();
    for (const render::Clip& one : character.clips) {
      if (one.kind == kind) clip = &one;
    }
    const double cycles =
        kind == render::ClipKind::kWalk
            ? snapshot.walked_cycles[i]
            : 1e-6 * static_cast<double>(snapshot.time_us) * clip->rate_hz / clip->frame_count;
    const auto frame =
        static_cast<std::uint32_t>((cycles - std::floor(cycles)) * clip->frame_count);
    agent.first_joint =
        (clip->first_frame + std::min(frame, clip->frame_count - 1)) * character.joint_count();
    agents.push_back(agent);
  }
  return agents;
}

}  // namespace throng::bench
