#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <set>
#include <utility>
#include <vector>

namespace throng::builtin {

/// What a face is made of; the painter has one brush for each.
enum class Region : std::uint8_t {
  kSkin,
  kHair,
  kTop,
  kBottom,
  kSock,
  kShoe,
  kSole,
  kHat,
  kBag,
  kScarf,
  kLining,  // inner side of hems and hat brims
};

/// Which limb a vertex hangs on; decides its first guess of a joint.
enum class Part : std::uint8_t {
  kTorso,
  kHead,
  kArmLeft,
  kArmRight,
  kLegLeft,
  kLegRight,
  kSkirt,
  kHair,  // hair that hangs or stands off the skull
  kBag,
  kFinger,  // `detail` holds side, finger and phalanx
};

/// `position` is canonical: a figure 1.78 m tall in A-pose, before the figure's own proportions are
/// applied, so that one painter and one set of landmarks serve everybody.
struct MeshVertex {
  glm::vec3 position{0.0F};
  Part part = Part::kTorso;
  std::uint8_t detail = 0;
};

/// A quad, or a triangle when corner[3] is -1. Counter-clockwise seen from outside.
struct MeshFace {
  std::array<int, 4> corner{-1, -1, -1, -1};
  Region region = Region::kSkin;
  std::uint8_t chart = 0;

  int size() const { return corner[3] < 0 ? 3 : 4; }
};

using Ring = std::vector<int>;  // vertex indices around a tube

/// A closed polygon mesh that grows by tubes and extrusions, so it stays one genus-0 surface.
class Mesh {
 public:
  std::vector<MeshVertex> vertices;
  std::vector<MeshFace> faces;
  std::set<std::pair<int, int>> cuts;   // uv seams that open a chart, smaller vertex first
  std::set<std::pair<int, int>> slits;  // uv seams that a chart doesn't need to lie flat

  int add_vertex(const glm::vec3& position, Part part, std::uint8_t detail = 0);
  int add_face(std::array<int, 4> corner, Region region, std::uint8_t chart);

  /// Quads between two closed rings of equal length; `from` to `to` points away from the body when
  /// rings run counter-clockwise seen from the tip. Returns the face of every column.
  std::vector<int> bridge(const Ring& from, const Ring& to, Region region, std::uint8_t chart,
                          bool flip);

  /// Lifts a patch of faces off the surface and closes the gap with walls. Every vertex of the
  /// patch's rim is doubled; `move` gives the lifted position of a patch vertex.
  /// Returns the wall faces in the order of the patch's rim edges.
  std::vector<int> extrude(const std::vector<int>& patch,
                           const std::function<glm::vec3(const glm::vec3&)>& move, Part part,
                           std::uint8_t detail, Region region, std::uint8_t chart);

  void cut(int a, int b) { cuts.insert({std::min(a, b), std::max(a, b)}); }
  void cut_path(const std::vector<int>& path);
  bool is_cut(int a, int b) const { return cuts.count({std::min(a, b), std::max(a, b)}) > 0; }
  void slit(int a, int b) { slits.insert({std::min(a, b), std::max(a, b)}); }
  bool is_slit(int a, int b) const { return slits.count({std::min(a, b), std::max(a, b)}) > 0; }

  /// Moves vertices towards the mean of their neighbours; `amount` is per vertex in [0, 1].
  void smooth(const std::vector<float>& amount, int rounds);

  /// Drops vertices that no face uses and renumbers; `paths` are renumbered too.
  void compact(std::vector<std::vector<int>>& paths);

  /// Splits quads along the better diagonal; left and right halves get mirrored diagonals.
  void triangulate();

  /// Splits the longest edges of a triangle mesh until it has `count` vertices. `importance` scales
  /// an edge's length by its region and place. New vertices are lifted towards the smooth surface.
  void refine(int count, const std::function<float(const MeshFace&, const glm::vec3&)>& importance);

  /// Area-weighted unit vertex normals of `position` [V].
  std::vector<glm::vec3> normals(const std::vector<glm::vec3>& position) const;

  std::vector<std::vector<int>> neighbours() const;
};

}  // namespace throng::builtin
