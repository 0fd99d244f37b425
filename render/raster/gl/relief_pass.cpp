#include "render/raster/gl/relief_pass.hpp"

#include <absl/strings/str_cat.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>

#include "render/raster/gl/program.hpp"
#include "render/raster/gl/shaders.hpp"

namespace throng::render::gl {
namespace {

/// A buffer with these bytes and no others; at least 16, as an empty one can't be bound.
void fill(std::uint32_t& buffer, const void* bytes, std::size_t size_bytes) {
  glDeleteBuffers(1, &buffer);
  glCreateBuffers(1, &buffer);
  glNamedBufferData(buffer, static_cast<GLsizeiptr>(std::max<std::size_t>(size_bytes, 16)), nullptr,
                    GL_STREAM_DRAW);
  if (size_bytes > 0) glNamedBufferSubData(buffer, 0, static_cast<GLsizeiptr>(size_bytes), bytes);
}

}  // namespace

void ReliefPass::release() {
  for (std::uint32_t* buffer : {&boxes_, &shape_, &base_, &regions_, &drawn_, &joints_}) {
    glDeleteBuffers(1, buffer);
    *buffer = 0;
  }
  glDeleteVertexArrays(1, &array_);
  glDeleteProgram(program_);
  array_ = program_ = 0;
}

absl::Status ReliefPass::prepare() {
  auto program = make_program("impostors", impostor_vertex_shader(), impostor_fragment_shader());
  if (!program.ok()) return program.status();
  program_ = *program;
  glCreateVertexArrays(1, &array_);
  return absl::OkStatus();
}

absl::Status ReliefPass::upload(const Cast& cast) {
  auto store = visibility::make_relief_store(cast);
  if (!store.ok()) return store.status();
  GLint most_bytes = 0;
  glGetIntegerv(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most_bytes);
  if (4 * store->shape.size() > static_cast<std::size_t>(most_bytes)) {
    return absl::ResourceExhaustedError(absl::StrCat("gl upload: impostors have ",
                                                     4 * store->shape.size(),
                                                     " bytes of a kind, at most ", most_bytes));
  }
  members_ = std::move(store->members);
  fill(boxes_, store->boxes.data(), store->boxes.size() * sizeof(ReliefBox));
  fill(shape_, store->shape.data(), 4 * store->shape.size());
  fill(base_, store->base.data(), 4 * store->base.size());
  fill(regions_, store->regions.data(), 4 * store->regions.size());
  return absl::OkStatus();
}

absl::Status ReliefPass::stage(const FrameGeometry& geometry, float px_per_tangent,
                               bool orthographic) {
  staged_.clear();
  if (geometry.representation.empty()) return absl::OkStatus();
  const std::size_t count = geometry.instances.size();
  if (geometry.representation.size() != count || geometry.jointed.size() != count) {
    return absl::InvalidArgumentError(absl::StrCat("gl draw: ", geometry.representation.size(),
                                                   " representations and ", geometry.jointed.size(),
                                                   " jointed instances, must be ", count));
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (geometry.representation[i] != Representation::kImpostor) continue;
    const VisibleInstance& instance = geometry.instances[i];
    const JointedInstance& jointed = geometry.jointed[i];
    if (instance.character >= members_.size()) continue;
    const visibility::ReliefStore::Member& member = members_[instance.character];
    const float distance_m =
        orthographic ? 1.0F : std::max(glm::length(instance.position_relative), 0.1F);
    for (std::uint32_t b = 0; b < member.box_count; ++b) {
      staged_.push_back({static_cast<std::uint32_t>(i), member.first_box + b, jointed.first_joint,
                         px_per_tangent / distance_m * instance.scale, jointed.cosine_scale,
                         jointed.sine_scale, instance.scale, 0.0F});
    }
  }
  if (staged_.empty()) return absl::OkStatus();
  fill(drawn_, staged_.data(), staged_.size() * sizeof(DrawnBox));
  fill(joints_, geometry.joints.data(), geometry.joints.size_bytes());
  return absl::OkStatus();
}

void ReliefPass::draw(const ReliefSearch& search) const {
  if (staged_.empty()) return;
  const std::uint32_t buffers[] = {boxes_, shape_, base_, regions_, drawn_, joints_};
  for (std::uint32_t i = 0; i < 6; ++i) {
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2 + i, buffers[i]);
  }
  glUseProgram(program_);
  glUniform3i(0, static_cast<GLint>(std::clamp(search.linear_steps, 1U, 1024U)),
              static_cast<GLint>(std::min(search.binary_steps, 32U)), search.adaptive ? 1 : 0);
  glBindVertexArray(array_);
  glDisable(GL_CULL_FACE);
  glDrawArraysInstanced(GL_TRIANGLES, 0, 36, static_cast<GLsizei>(staged_.size()));
}

}  // namespace throng::render::gl
