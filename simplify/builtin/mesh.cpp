#include "simplify/builtin/mesh.hpp"

#include <algorithm>
#include <map>
#include <queue>
#include <unordered_map>

namespace throng::builtin {
namespace {

std::uint64_t edge_key(int a, int b) {
  return static_cast<std::uint64_t>(static_cast<std::uint32_t>(a)) << 32 |
         static_cast<std::uint32_t>(b);
}

}  // namespace

int Mesh::add_vertex(const glm::vec3& position, Part part, std::uint8_t detail) {
  vertices.push_back({position, part, detail});
  return static_cast<int>(vertices.size()) - 1;
}

int Mesh::add_face(std::array<int, 4> corner, Region region, std::uint8_t chart) {
  faces.push_back({corner, region, chart});
  return static_cast<int>(faces.size()) - 1;
}

std::vector<int> Mesh::bridge(const Ring& from, const Ring& to, Region region, std::uint8_t chart,
                              bool flip) {
  std::vector<int> made;
  const std::size_t count = from.size();
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t next = (i + 1) % count;
    std::array<int, 4> corner{from[i], from[next], to[next], to[i]};
    if (flip) std::reverse(corner.begin(), corner.end());
    made.push_back(add_face(corner, region, chart));
  }
  return made;
}

std::vector<int> Mesh::extrude(const std::vector<int>& patch,
                               const std::function<glm::vec3(const glm::vec3&)>& move, Part part,
                               std::uint8_t detail, Region region, std::uint8_t chart) {
  // rim edges: directed edges of the patch whose twin is outside
  std::map<std::pair<int, int>, int> directed;
  for (const int face : patch) {
    const MeshFace& f = faces[face];
    for (int i = 0; i < f.size(); ++i) directed[{f.corner[i], f.corner[(i + 1) % f.size()]}] = face;
  }
  std::vector<std::pair<int, int>> rim;
  for (const int face : patch) {
    const MeshFace f = faces[face];
    for (int i = 0; i < f.size(); ++i) {
      const std::pair<int, int> edge{f.corner[i], f.corner[(i + 1) % f.size()]};
      if (directed.count({edge.second, edge.first}) == 0) rim.push_back(edge);
    }
  }
  std::unordered_map<int, int> lifted;
  for (const auto& edge : rim) lifted[edge.first] = -1;
  // inner vertices of the patch move, rim vertices are doubled, in a fixed order
  std::set<int> all;
  for (const int face : patch) {
    for (int i = 0; i < faces[face].size(); ++i) all.insert(faces[face].corner[i]);
  }
  for (const int vertex : all) {
    const glm::vec3 target = move(vertices[vertex].position);
    if (lifted.count(vertex) > 0) {
      lifted[vertex] = add_vertex(target, part, detail);
    } else {
      vertices[vertex] = {target, part, detail};
    }
  }
  for (const int face : patch) {
    MeshFace& f = faces[face];
    for (int i = 0; i < f.size(); ++i) {
      const auto found = lifted.find(f.corner[i]);
      if (found != lifted.end()) f.corner[i] = found->second;
    }
    f.region = region;
    f.chart = chart;
  }
  std::vector<int> walls;
  for (const auto& [a, b] : rim) {
    walls.push_back(add_face({a, b, lifted[b], lifted[a]}, region, chart));
  }
  return walls;
}

void Mesh::cut_path(const std::vector<int>& path) {
  for (std::size_t i = 1; i < path.size(); ++i) cut(path[i - 1], path[i]);
}

std::vector<std::vector<int>> Mesh::neighbours() const {
  std::vector<std::vector<int>> out(vertices.size());
  for (const MeshFace& f : faces) {
    for (int i = 0; i < f.size(); ++i) {
      // the surface is closed: every undirected edge appears once in each direction
      out[f.corner[i]].push_back(f.corner[(i + 1) % f.size()]);
    }
  }
  return out;
}

void Mesh::smooth(const std::vector<float>& amount, int rounds) {
  const std::vector<std::vector<int>> near = neighbours();
  for (int round = 0; round < rounds; ++round) {
    std::vector<glm::vec3> next(vertices.size());
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      next[v] = vertices[v].position;
      if (near[v].empty()) continue;
      glm::vec3 mean{0.0F};
      for (const int other : near[v]) mean += vertices[other].position;
      mean /= static_cast<float>(near[v].size());
      next[v] = glm::mix(vertices[v].position, mean, amount[v]);
    }
    for (std::size_t v = 0; v < vertices.size(); ++v) vertices[v].position = next[v];
  }
}

void Mesh::compact(std::vector<std::vector<int>>& paths) {
  std::vector<int> index(vertices.size(), -1);
  for (const MeshFace& f : faces) {
    for (int i = 0; i < f.size(); ++i) index[f.corner[i]] = 0;
  }
  std::vector<MeshVertex> kept;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (index[v] < 0) continue;
    index[v] = static_cast<int>(kept.size());
    kept.push_back(vertices[v]);
  }
  vertices = std::move(kept);
  for (MeshFace& f : faces) {
    for (int i = 0; i < f.size(); ++i) f.corner[i] = index[f.corner[i]];
  }
  std::set<std::pair<int, int>> old_cuts;
  old_cuts.swap(cuts);
  for (const auto& [a, b] : old_cuts) {
    if (index[a] >= 0 && index[b] >= 0) cut(index[a], index[b]);
  }
  for (std::vector<int>& path : paths) {
    for (int& v : path) v = index[v];
    std::erase(path, -1);
  }
}

void Mesh::triangulate() {
  std::vector<MeshFace> out;
  out.reserve(faces.size() * 2);
  for (const MeshFace& f : faces) {
    if (f.size() == 3) {
      out.push_back(f);
      continue;
    }
    glm::vec3 p[4];
    for (int i = 0; i < 4; ++i) p[i] = vertices[f.corner[i]].position;
    // the flatter split; near ties go by which corner is nearest the symmetry plane
    const auto fold = [&](int a, int b, int c, int d) {
      const glm::vec3 n0 = glm::cross(p[b] - p[a], p[c] - p[a]);
      const glm::vec3 n1 = glm::cross(p[c] - p[a], p[d] - p[a]);
      const float len = glm::length(n0) * glm::length(n1);
      const float cosine = len > 1e-14F ? glm::dot(n0, n1) / len : -1.0F;
      return (1.0F - cosine) * 0.5F + 0.15F * glm::length(p[a] - p[c]) /
                                          (glm::length(p[a] - p[c]) + glm::length(p[b] - p[d]));
    };
    const float first = fold(0, 1, 2, 3);
    const float second = fold(1, 2, 3, 0);
    bool use_first = first < second;
    if (std::abs(first - second) < 1e-4F) {
      int nearest = 0;
      for (int i = 1; i < 4; ++i) {
        const float a = std::abs(p[i].y) * 4.0F + p[i].z,
                    b = std::abs(p[nearest].y) * 4.0F + p[nearest].z;
        if (a < b) nearest = i;
      }
      use_first = nearest % 2 == 0;
    }
    MeshFace a = f, b = f;
    if (use_first) {
      a.corner = {f.corner[0], f.corner[1], f.corner[2], -1};
      b.corner = {f.corner[0], f.corner[2], f.corner[3], -1};
    } else {
      a.corner = {f.corner[1], f.corner[2], f.corner[3], -1};
      b.corner = {f.corner[1], f.corner[3], f.corner[0], -1};
    }
    out.push_back(a);
    out.push_back(b);
  }
  faces = std::move(out);
}

void Mesh::refine(int count,
                  const std::function<float(const MeshFace&, const glm::vec3&)>& importance) {
  std::vector<glm::vec3> position(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) position[v] = vertices[v].position;
  std::vector<glm::vec3> normal = normals(position);
  std::unordered_map<std::uint64_t, int> face_of;  // directed edge -> face
  const auto enter = [&](int face) {
    for (int i = 0; i < 3; ++i) {
      face_of[edge_key(faces[face].corner[i], faces[face].corner[(i + 1) % 3])] = face;
    }
  };
  struct Candidate {
    float length;
    int a, b;
    bool operator<(const Candidate& other) const {
      if (length != other.length) return length < other.length;
      return a != other.a ? a > other.a : b > other.b;
    }
  };
  std::priority_queue<Candidate> queue;
  const auto offer = [&](int a, int b, int face) {
    const glm::vec3 pa = vertices[a].position, pb = vertices[b].position;
    const float scale = importance(faces[face], (pa + pb) * 0.5F);
    // rounding makes mirrored edges tie, so that both halves are split in turn
    const float length = std::round(glm::length(pa - pb) * scale * 1e5F);
    if (scale > 0.0F) queue.push({length, std::min(a, b), std::max(a, b)});
  };
  for (std::size_t face = 0; face < faces.size(); ++face) enter(static_cast<int>(face));
  for (std::size_t face = 0; face < faces.size(); ++face) {
    for (int i = 0; i < 3; ++i) {
      const int a = faces[face].corner[i], b = faces[face].corner[(i + 1) % 3];
      if (a < b) offer(a, b, static_cast<int>(face));
    }
  }
  std::unordered_map<std::uint64_t, bool> seam;
  while (static_cast<int>(vertices.size()) < count && !queue.empty()) {
    const Candidate top = queue.top();
    queue.pop();
    const auto left = face_of.find(edge_key(top.a, top.b));
    const auto right = face_of.find(edge_key(top.b, top.a));
    if (left == face_of.end() || right == face_of.end()) continue;
    const int f0 = left->second, f1 = right->second;
    // a seam would grow by a wedge, so seams are left as they are
    if (faces[f0].chart != faces[f1].chart || is_cut(top.a, top.b) || is_slit(top.a, top.b))
      continue;
    const MeshVertex &va = vertices[top.a], &vb = vertices[top.b];
    // midpoint of the cubic whose ends are perpendicular to the vertex normals
    const glm::vec3 edge = vb.position - va.position;
    glm::vec3 lift = (normal[top.b] * glm::dot(edge, normal[top.b]) -
                      normal[top.a] * glm::dot(edge, normal[top.a])) *
                     0.125F;
    const float limit = 0.12F * glm::length(edge);
    if (glm::length(lift) > limit) lift *= limit / glm::length(lift);
    const int made = add_vertex((va.position + vb.position) * 0.5F + lift, va.part, va.detail);
    normal.push_back(glm::normalize(normal[top.a] + normal[top.b] + 1e-6F));
    for (const int face : {f0, f1}) {
      const MeshFace old = faces[face];
      for (int i = 0; i < 3; ++i) face_of.erase(edge_key(old.corner[i], old.corner[(i + 1) % 3]));
    }
    for (const int face : {f0, f1}) {
      MeshFace old = faces[face];
      int i = 0;
      while (!((old.corner[i] == top.a && old.corner[(i + 1) % 3] == top.b) ||
               (old.corner[i] == top.b && old.corner[(i + 1) % 3] == top.a))) {
        ++i;
      }
      const int from = old.corner[i], to = old.corner[(i + 1) % 3], apex = old.corner[(i + 2) % 3];
      faces[face].corner = {from, made, apex, -1};
      MeshFace second = old;
      second.corner = {made, to, apex, -1};
      faces.push_back(second);
      const int added = static_cast<int>(faces.size()) - 1;
      enter(face);
      enter(added);
    }
    for (const int face : {f0, f1}) {
      for (int i = 0; i < 3; ++i)
        offer(faces[face].corner[i], faces[face].corner[(i + 1) % 3], face);
    }
    for (std::size_t face = faces.size() - 2; face < faces.size(); ++face) {
      for (int i = 0; i < 3; ++i) {
        offer(faces[face].corner[i], faces[face].corner[(i + 1) % 3], static_cast<int>(face));
      }
    }
  }
}

std::vector<glm::vec3> Mesh::normals(const std::vector<glm::vec3>& position) const {
  std::vector<glm::vec3> out(position.size(), glm::vec3{0.0F});
  for (const MeshFace& f : faces) {
    for (int i = 1; i + 1 < f.size(); ++i) {
      const int a = f.corner[0], b = f.corner[i], c = f.corner[i + 1];
      const glm::vec3 n = glm::cross(position[b] - position[a], position[c] - position[a]);
      out[a] += n;
      out[b] += n;
      out[c] += n;
    }
  }
  for (glm::vec3& n : out) {
    const float length = glm::length(n);
    n = length > 1e-12F ? n / length : glm::vec3{0.0F, 0.0F, 1.0F};
  }
  return out;
}

}  // namespace throng::builtin
