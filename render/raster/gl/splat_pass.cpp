#include "render/raster/gl/splat_pass.hpp"

#include <absl/strings/str_cat.h>
#include <epoxy/gl.h>

#include <cstring>

#include "render/raster/gl/program.hpp"
#include "render/raster/gl/shaders.hpp"

namespace throng::render::gl {

void SplatPass::release() {
  buffer_.release();
  glDeleteVertexArrays(1, &array_);
  glDeleteProgram(program_);
  array_ = program_ = 0;
}

absl::Status SplatPass::prepare(int samples) {
  auto program =
      make_program("splats", splat_vertex_shader(samples), splat_fragment_shader(samples));
  if (!program.ok()) return program.status();
  program_ = *program;
  glCreateVertexArrays(1, &array_);
  for (GLuint attribute = 0; attribute < 6; ++attribute) {
    glEnableVertexArrayAttrib(array_, attribute);
    glVertexArrayAttribBinding(array_, attribute, 0);
  }
  glVertexArrayAttribFormat(array_, 0, 3, GL_FLOAT, GL_FALSE, offsetof(Splat, position_relative));
  glVertexArrayAttribFormat(array_, 1, 1, GL_FLOAT, GL_FALSE, offsetof(Splat, radius_m));
  glVertexArrayAttribFormat(array_, 2, 2, GL_SHORT, GL_TRUE, offsetof(Splat, normal));
  glVertexArrayAttribIFormat(array_, 3, 1, GL_UNSIGNED_INT, offsetof(Splat, base));
  glVertexArrayAttribIFormat(array_, 4, 1, GL_UNSIGNED_INT, offsetof(Splat, regions));
  glVertexArrayAttribIFormat(array_, 5, 1, GL_UNSIGNED_INT, offsetof(Splat, visible));
  glEnable(GL_PROGRAM_POINT_SIZE);
  return absl::OkStatus();
}

absl::Status SplatPass::stage(std::span<const Splat> splats) {
  count_ = 0;
  if (splats.empty()) return absl::OkStatus();
  if (splats.size() > kMostSplats) {
    return absl::ResourceExhaustedError(
        absl::StrCat("gl draw: ", splats.size(), " splats, at most ", kMostSplats));
  }
  if (auto status = buffer_.reserve(splats.size_bytes()); !status.ok()) return status;
  std::memcpy(buffer_.data(), splats.data(), splats.size_bytes());
  count_ = splats.size();
  return absl::OkStatus();
}

void SplatPass::set_view(const glm::mat3& view_from_relative, float px_per_tangent,
                         std::uint32_t width_px, std::uint32_t height_px,
                         std::size_t instance_count) const {
  if (count_ == 0) return;
  glProgramUniformMatrix3fv(program_, 0, 1, GL_FALSE, &view_from_relative[0][0]);
  glProgramUniform3f(program_, 3, static_cast<GLfloat>(width_px), static_cast<GLfloat>(height_px),
                     px_per_tangent);
  glProgramUniform1ui(program_, 4, static_cast<GLuint>(instance_count));
}

void SplatPass::draw() const {
  if (count_ == 0) return;
  glVertexArrayVertexBuffer(array_, 0, buffer_.name(), 0, sizeof(Splat));
  glUseProgram(program_);
  glBindVertexArray(array_);
  glDrawArrays(GL_POINTS, 0, static_cast<GLsizei>(count_));
}

}  // namespace throng::render::gl
