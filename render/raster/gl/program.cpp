#include "render/raster/gl/program.hpp"

#include <absl/strings/str_cat.h>
#include <epoxy/gl.h>

#include <utility>

namespace throng::render::gl {
namespace {

static_assert(sizeof(GLuint) == sizeof(std::uint32_t));

/// Of a shader or a program: true where it went well, and what the driver said.
template <typename Get, typename GetLog>
std::pair<bool, std::string> outcome(GLuint object, GLenum what, Get get, GetLog get_log) {
  GLint ok = GL_FALSE;
  get(object, what, &ok);
  char log[1024] = "";
  get_log(object, sizeof(log), nullptr, log);
  return {ok == GL_TRUE, log};
}

}  // namespace

absl::StatusOr<std::uint32_t> make_program(const char* name, const std::string& vertex,
                                           const std::string& fragment) {
  const GLuint program = glCreateProgram();
  const auto failed = [&](const char* step, const std::string& log) {
    glDeleteProgram(program);
    return absl::InternalError(absl::StrCat("gl: ", step, " ", name, ": ", log));
  };
  for (const auto& [stage, source] :
       {std::pair(GL_VERTEX_SHADER, &vertex), std::pair(GL_FRAGMENT_SHADER, &fragment)}) {
    const GLuint shader = glCreateShader(static_cast<GLenum>(stage));
    const char* const text = source->c_str();
    glShaderSource(shader, 1, &text, nullptr);
    glCompileShader(shader);
    const auto [ok, log] = outcome(shader, GL_COMPILE_STATUS, glGetShaderiv, glGetShaderInfoLog);
    if (ok) glAttachShader(program, shader);
    glDeleteShader(shader);  // an attached one lives as long as the program
    if (!ok) return failed("shader", log);
  }
  glLinkProgram(program);
  const auto [ok, log] = outcome(program, GL_LINK_STATUS, glGetProgramiv, glGetProgramInfoLog);
  if (!ok) return failed("program", log);
  return program;
}

}  // namespace throng::render::gl
