#pragma once

#include <string>

namespace throng::render::gl {

/// What the programs are compiled for.
struct ShaderOptions {
  bool cutout = false;     // some texel of the cast is a hole
  bool two_sided = false;  // back faces are seen
  bool tint_mask = false;  // some character has a tint mask
  bool tones = false;      // some character has CornerTones
  bool surroundings = false;
};

std::string agent_vertex_shader(const ShaderOptions& options);
std::string agent_fragment_shader(const ShaderOptions& options);
std::string impostor_vertex_shader();
std::string impostor_fragment_shader();
/// @param samples  of a pixel; each is tested apart.
std::string splat_vertex_shader(int samples);
std::string splat_fragment_shader(int samples);
std::string blob_vertex_shader();
std::string blob_fragment_shader();
std::string cast_shadow_vertex_shader();
std::string cast_shadow_fragment_shader();
std::string floor_fragment_shader();
std::string background_vertex_shader();
std::string background_fragment_shader();

}  // namespace throng::render::gl
