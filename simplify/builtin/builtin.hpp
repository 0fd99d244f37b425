#pragma once

#include <string>
#include <vector>

#include "simplify/source_character.hpp"

namespace throng::builtin {

using simplify::SourceCharacter;

/// Names of the built-in cast, in a fixed order.
std::vector<std::string> builtin_names();

/// Counts that replace those of the table's row; 0 keeps them.
struct MeshCounts {
  int vertices = 0;
  int uvs = 0;
};

/// Models, unwraps, paints, rigs and animates one member of the cast. Needs no file; the same name
/// gives the same bytes every time. May be called from several threads at once.
///
/// The mesh is one closed surface with the vertex, triangle, UV and joint counts of a row of table
/// 1 in Dong & Peng (2019); T = 2V - 4. Clips: idle, walk, run at 30 Hz, in place.
///
/// @param name  one of `builtin_names()`; any other name gives an empty character with a note.
SourceCharacter make_builtin(const std::string& name, const MeshCounts& counts = {});

}  // namespace throng::builtin
