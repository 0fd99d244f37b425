#include "simplify/builtin/unwrap.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>
#include <unordered_map>

namespace throng::builtin {
namespace {

std::uint64_t edge_key(int a, int b) {
  return static_cast<std::uint64_t>(static_cast<std::uint32_t>(a)) << 32 |
         static_cast<std::uint32_t>(b);
}

/// Faces of a mesh with their seams resolved: components and wedges.
struct Topology {
  std::unordered_map<std::uint64_t, std::pair<int, int>> face_of;  // directed edge -> face, corner
  std::vector<int> component;                                      // [F]
  std::vector<std::array<int, 4>> wedge;                           // [F] by corner
  int component_count = 0;
  int wedge_count = 0;
  std::vector<int> wedge_vertex;

  bool with_slits = true;

  explicit Topology(const Mesh& mesh, bool with_slits = true) : with_slits(with_slits) {
    const std::size_t faces = mesh.faces.size();
    face_of.reserve(faces * 8);
    for (std::size_t f = 0; f < faces; ++f) {
      const MeshFace& face = mesh.faces[f];
      for (int i = 0; i < face.size(); ++i) {
        face_of[edge_key(face.corner[i], face.corner[(i + 1) % face.size()])] = {
            static_cast<int>(f), i};
      }
    }
    component.assign(faces, -1);
    std::vector<int> parent(faces * 4);
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int x) {
      while (parent[x] != x) x = parent[x] = parent[parent[x]];
      return x;
    };
    for (std::size_t start = 0; start < faces; ++start) {
      if (component[start] >= 0) continue;
      std::vector<int> stack{static_cast<int>(start)};
      component[start] = component_count;
      while (!stack.empty()) {
        const int f = stack.back();
        stack.pop_back();
        const MeshFace& face = mesh.faces[f];
        const int size = face.size();
        for (int i = 0; i < size; ++i) {
          const int a = face.corner[i], b = face.corner[(i + 1) % size];
          if (is_seam(mesh, f, a, b)) continue;
          const auto [other, j] = face_of.at(edge_key(b, a));
          const int other_size = mesh.faces[other].size();
          // corner i of f is vertex a, which is corner j + 1 of the other face
          parent[root(f * 4 + i)] = root(other * 4 + (j + 1) % other_size);
          parent[root(f * 4 + (i + 1) % size)] = root(other * 4 + j);
          if (component[other] < 0) {
            component[other] = component_count;
            stack.push_back(other);
          }
        }
      }
      ++component_count;
    }
    wedge.resize(faces);
    std::vector<int> number(faces * 4, -1);
    for (std::size_t f = 0; f < faces; ++f) {
      wedge[f] = {-1, -1, -1, -1};
      for (int i = 0; i < mesh.faces[f].size(); ++i) {
        int& n = number[root(static_cast<int>(f) * 4 + i)];
        if (n < 0) {
          n = wedge_count++;
          wedge_vertex.push_back(mesh.faces[f].corner[i]);
        }
        wedge[f][i] = n;
      }
    }
  }

  bool is_seam(const Mesh& mesh, int f, int a, int b) const {
    const auto other = face_of.find(edge_key(b, a));
    if (other == face_of.end()) return true;
    return mesh.faces[other->second.first].chart != mesh.faces[f].chart || mesh.is_cut(a, b) ||
           (with_slits && mesh.is_slit(a, b));
  }

  /// Border loops of every component as wedges, in the winding of the faces.
  std::vector<std::vector<std::vector<int>>> borders(const Mesh& mesh) const {
    std::vector<std::map<int, int>> next(component_count);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const MeshFace& face = mesh.faces[f];
      for (int i = 0; i < face.size(); ++i) {
        const int j = (i + 1) % face.size();
        if (is_seam(mesh, static_cast<int>(f), face.corner[i], face.corner[j])) {
          next[component[f]][wedge[f][i]] = wedge[f][j];
        }
      }
    }
    std::vector<std::vector<std::vector<int>>> out(component_count);
    for (int c = 0; c < component_count; ++c) {
      while (!next[c].empty()) {
        std::vector<int> loop;
        int at = next[c].begin()->first;
        while (true) {
          const auto found = next[c].find(at);
          if (found == next[c].end()) break;
          loop.push_back(at);
          at = found->second;
          next[c].erase(found);
        }
        out[c].push_back(loop);
      }
    }
    return out;
  }
};

/// Symmetric positive definite system by rows, solved by conjugate gradients.
struct Laplace {
  std::vector<int> start, column;
  std::vector<double> value, diagonal;

  void multiply(const std::vector<double>& x, std::vector<double>& y) const {
    for (std::size_t r = 0; r + 1 < start.size(); ++r) {
      double sum = diagonal[r] * x[r];
      for (int k = start[r]; k < start[r + 1]; ++k) sum += value[k] * x[column[k]];
      y[r] = sum;
    }
  }

  void solve(const std::vector<double>& b, std::vector<double>& x, int rounds,
             double tolerance) const {
    const std::size_t n = b.size();
    std::vector<double> r(n), z(n), p(n), q(n);
    multiply(x, q);
    double norm = 1e-30;
    for (std::size_t i = 0; i < n; ++i) {
      r[i] = b[i] - q[i];
      norm += b[i] * b[i];
    }
    double rho = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      z[i] = r[i] / diagonal[i];
      p[i] = z[i];
      rho += r[i] * z[i];
    }
    for (int round = 0; round < rounds; ++round) {
      multiply(p, q);
      double pq = 0.0;
      for (std::size_t i = 0; i < n; ++i) pq += p[i] * q[i];
      if (std::abs(pq) < 1e-300) return;
      const double alpha = rho / pq;
      double rest = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        x[i] += alpha * p[i];
        r[i] -= alpha * q[i];
        rest += r[i] * r[i];
      }
      if (rest < tolerance * tolerance * norm) return;
      double next = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        z[i] = r[i] / diagonal[i];
        next += r[i] * z[i];
      }
      const double beta = next / rho;
      rho = next;
      for (std::size_t i = 0; i < n; ++i) p[i] = z[i] + beta * p[i];
    }
  }
};

struct Island {
  std::vector<int> wedges;                      // global number of each point
  std::vector<std::array<int, 3>> triangles;    // local
  std::vector<std::array<glm::dvec2, 3>> rest;  // each triangle flattened on its own
  std::vector<glm::dvec2> uv;
  double density = 1.0;
};

double cross2(const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; }

Laplace assemble(const Island& island, const std::vector<std::array<double, 3>>& weight,
                 double pin) {
  const std::size_t n = island.wedges.size();
  std::vector<std::map<int, double>> rows(n);
  for (std::size_t t = 0; t < island.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const int a = island.triangles[t][i], b = island.triangles[t][(i + 1) % 3];
      rows[a][b] += weight[t][i];
      rows[b][a] += weight[t][i];
    }
  }
  Laplace out;
  out.start.push_back(0);
  for (std::size_t r = 0; r < n; ++r) {
    double sum = r == 0 ? pin : 0.0;
    for (const auto& [c, w] : rows[r]) {
      out.column.push_back(c);
      out.value.push_back(-w);
      sum += w;
    }
    out.diagonal.push_back(sum);
    out.start.push_back(static_cast<int>(out.column.size()));
  }
  return out;
}

/// Tutte's embedding: the border on a circle, every other point the mean of its neighbours.
void embed(Island& island, const std::vector<int>& border) {
  const std::size_t n = island.wedges.size();
  std::vector<double> ring(n, 0.0);
  std::vector<char> fixed(n, 0);
  island.uv.assign(n, glm::dvec2{0.0});
  // the length of each border edge comes from the triangle that has it
  std::map<std::pair<int, int>, double> length;
  double area = 0.0;
  for (std::size_t t = 0; t < island.triangles.size(); ++t) {
    const auto& r = island.rest[t];
    area += 0.5 * cross2(r[1] - r[0], r[2] - r[0]);
    for (int i = 0; i < 3; ++i) {
      length[{island.triangles[t][i], island.triangles[t][(i + 1) % 3]}] =
          glm::length(r[(i + 1) % 3] - r[i]);
    }
  }
  double total = 0.0;
  for (std::size_t i = 0; i < border.size(); ++i)
    total += length[{border[i], border[(i + 1) % border.size()]}];
  const double radius = std::sqrt(area / 3.14159265358979);
  double at = 0.0;
  for (std::size_t i = 0; i < border.size(); ++i) {
    const double angle = 2.0 * 3.14159265358979 * at / total;
    island.uv[border[i]] = radius * glm::dvec2{std::cos(angle), std::sin(angle)};
    fixed[border[i]] = 1;
    at += length[{border[i], border[(i + 1) % border.size()]}];
  }
  std::vector<std::vector<int>> near(n);
  for (const auto& t : island.triangles) {
    for (int i = 0; i < 3; ++i) {
      near[t[i]].push_back(t[(i + 1) % 3]);
      near[t[i]].push_back(t[(i + 2) % 3]);
    }
  }
  Laplace system;
  system.start.push_back(0);
  std::vector<double> bx(n, 0.0), by(n, 0.0), x(n, 0.0), y(n, 0.0);
  for (std::size_t r = 0; r < n; ++r) {
    if (fixed[r]) {
      system.diagonal.push_back(1.0);
      bx[r] = x[r] = island.uv[r].x;
      by[r] = y[r] = island.uv[r].y;
    } else {
      system.diagonal.push_back(static_cast<double>(near[r].size()));
      for (const int c : near[r]) {
        if (fixed[c]) {
          bx[r] += island.uv[c].x;
          by[r] += island.uv[c].y;
        } else {
          system.column.push_back(c);
          system.value.push_back(-1.0);
        }
      }
    }
    system.start.push_back(static_cast<int>(system.column.size()));
  }
  system.solve(bx, x, 600, 1e-9);
  system.solve(by, y, 600, 1e-9);
  for (std::size_t r = 0; r < n; ++r) island.uv[r] = {x[r], y[r]};
}

/// Largest step in [0, 1] along `move` before a triangle loses its area.
double longest_step(const Island& island, const std::vector<glm::dvec2>& move) {
  double limit = 1.0;
  for (const auto& t : island.triangles) {
    const glm::dvec2 a = island.uv[t[1]] - island.uv[t[0]], b = island.uv[t[2]] - island.uv[t[0]];
    const glm::dvec2 da = move[t[1]] - move[t[0]], db = move[t[2]] - move[t[0]];
    // area(s) = c + s b1 + s^2 a2
    const double c = cross2(a, b), b1 = cross2(a, db) + cross2(da, b), a2 = cross2(da, db);
    double root = 2.0;
    if (std::abs(a2) < 1e-30) {
      if (b1 < 0.0) root = -c / b1;
    } else {
      const double d = b1 * b1 - 4.0 * a2 * c;
      if (d >= 0.0) {
        const double s = std::sqrt(d);
        for (const double r : {(-b1 - s) / (2.0 * a2), (-b1 + s) / (2.0 * a2)}) {
          if (r > 0.0) root = std::min(root, r);
        }
      }
    }
    limit = std::min(limit, root * 0.85);
  }
  return limit;
}

/// Symmetric Dirichlet energy of one triangle: 2 + 2 where it keeps its shape, infinite at a flip.
double stretch(const std::array<glm::dvec2, 3>& rest, const glm::dvec2& a, const glm::dvec2& b,
               const glm::dvec2& c) {
  const glm::dvec2 r1 = rest[1] - rest[0], r2 = rest[2] - rest[0], u1 = b - a, u2 = c - a;
  const double area0 = cross2(r1, r2), area1 = cross2(u1, u2);
  if (area1 <= 1e-14) return 1e30;
  const double inverse = 1.0 / area0;
  const glm::dvec2 jx = (u1 * r2.y - u2 * r1.y) * inverse, jy = (u2 * r1.x - u1 * r2.x) * inverse;
  const double frobenius = glm::dot(jx, jx) + glm::dot(jy, jy), det = area1 * inverse;
  return frobenius * (1.0 + 1.0 / (det * det)) * area0;
}

double energy(const Island& island, const std::vector<glm::dvec2>& uv) {
  double sum = 0.0;
  for (std::size_t t = 0; t < island.triangles.size(); ++t) {
    const auto& k = island.triangles[t];
    sum += stretch(island.rest[t], uv[k[0]], uv[k[1]], uv[k[2]]);
  }
  return sum;
}

void flatten(Island& island) {
  std::vector<std::array<double, 3>> weight(island.triangles.size());
  for (std::size_t t = 0; t < island.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const auto& r = island.rest[t];
      const glm::dvec2 a = r[i] - r[(i + 2) % 3], b = r[(i + 1) % 3] - r[(i + 2) % 3];
      weight[t][i] = std::clamp(0.5 * glm::dot(a, b) / std::max(1e-12, cross2(a, b)), 0.08, 4.0);
    }
  }
  const Laplace system = assemble(island, weight, 1e-6);
  const std::size_t n = island.wedges.size();
  std::vector<double> bx(n), by(n), x(n), y(n);
  double before = energy(island, island.uv);
  for (int round = 0; round < 40; ++round) {
    std::fill(bx.begin(), bx.end(), 0.0);
    std::fill(by.begin(), by.end(), 0.0);
    for (std::size_t t = 0; t < island.triangles.size(); ++t) {
      const auto& k = island.triangles[t];
      const auto& r = island.rest[t];
      // best rotation of the triangle
      double c = 0.0, s = 0.0;
      for (int i = 0; i < 3; ++i) {
        const glm::dvec2 e = r[(i + 1) % 3] - r[i], u = island.uv[k[(i + 1) % 3]] - island.uv[k[i]];
        c += weight[t][i] * glm::dot(e, u);
        s += weight[t][i] * cross2(e, u);
      }
      const double length = std::max(1e-30, std::hypot(c, s));
      c /= length;
      s /= length;
      for (int i = 0; i < 3; ++i) {
        const glm::dvec2 e = r[(i + 1) % 3] - r[i];
        const glm::dvec2 turned{c * e.x - s * e.y, s * e.x + c * e.y};
        const double w = weight[t][i];
        bx[k[i]] -= w * turned.x;
        by[k[i]] -= w * turned.y;
        bx[k[(i + 1) % 3]] += w * turned.x;
        by[k[(i + 1) % 3]] += w * turned.y;
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      x[i] = island.uv[i].x;
      y[i] = island.uv[i].y;
    }
    bx[0] += 1e-6 * x[0];
    by[0] += 1e-6 * y[0];
    system.solve(bx, x, 120, 1e-5);
    system.solve(by, y, 120, 1e-5);
    std::vector<glm::dvec2> move(n);
    for (std::size_t i = 0; i < n; ++i) move[i] = glm::dvec2{x[i], y[i]} - island.uv[i];
    double step = longest_step(island, move);
    std::vector<glm::dvec2> trial(n);
    double after = before;
    for (int halving = 0; halving < 5; ++halving, step *= 0.5) {
      for (std::size_t i = 0; i < n; ++i) trial[i] = island.uv[i] + move[i] * step;
      after = energy(island, trial);
      if (after < before) break;
    }
    if (after < before) island.uv = trial;
    // what blocks the step is small and local: ease single points
    std::vector<std::vector<int>> around(n);
    for (std::size_t t = 0; t < island.triangles.size(); ++t) {
      for (const int k : island.triangles[t]) around[k].push_back(static_cast<int>(t));
    }
    for (int sweep = 0; sweep < 2; ++sweep) {
      for (std::size_t i = 0; i < n; ++i) {
        const auto local = [&](const glm::dvec2& p) {
          double sum = 0.0;
          for (const int t : around[i]) {
            glm::dvec2 q[3];
            for (int c = 0; c < 3; ++c) {
              const int k = island.triangles[t][c];
              q[c] = k == static_cast<int>(i) ? p : island.uv[k];
            }
            sum += stretch(island.rest[t], q[0], q[1], q[2]);
          }
          return sum;
        };
        const glm::dvec2 p = island.uv[i];
        const double e0 = local(p);
        double size = 0.0;
        for (const int t : around[i])
          size = std::max(size, glm::length(island.rest[t][1] - island.rest[t][0]));
        const double h = 1e-3 * size;
        const glm::dvec2 g{(local(p + glm::dvec2{h, 0}) - local(p - glm::dvec2{h, 0})),
                           (local(p + glm::dvec2{0, h}) - local(p - glm::dvec2{0, h}))};
        const double length = glm::length(g);
        if (!(length > 0.0) || !std::isfinite(length)) continue;
        double reach = 0.3 * size;
        for (int halving = 0; halving < 6; ++halving, reach *= 0.4) {
          const glm::dvec2 q = p - g * (reach / length);
          if (local(q) < e0) {
            island.uv[i] = q;
            break;
          }
        }
      }
    }
    after = energy(island, island.uv);
    const bool done = after > before * (1.0 - 2e-4);
    before = after;
    if (done && round > 4) break;
  }
}

/// Turns the island so that its bounding box is small.
void straighten(Island& island) {
  double best = 1e30, best_angle = 0.0;
  for (int step = 0; step < 36; ++step) {
    const double angle = step * 3.14159265358979 / 72.0;
    glm::dvec2 low{1e30}, high{-1e30};
    for (const glm::dvec2& p : island.uv) {
      const glm::dvec2 q{p.x * std::cos(angle) - p.y * std::sin(angle),
                         p.x * std::sin(angle) + p.y * std::cos(angle)};
      low = glm::min(low, q);
      high = glm::max(high, q);
    }
    const double area = (high.x - low.x) * (high.y - low.y);
    if (area < best * 0.999) {
      best = area;
      best_angle = angle;
    }
  }
  glm::dvec2 low{1e30};
  for (glm::dvec2& p : island.uv) {
    p = {p.x * std::cos(best_angle) - p.y * std::sin(best_angle),
         p.x * std::sin(best_angle) + p.y * std::cos(best_angle)};
    low = glm::min(low, p);
  }
  for (glm::dvec2& p : island.uv) p -= low;
}

constexpr int kGrid = 192;  // cells of the packing raster along one side

struct Stamp {
  int width = 0, height = 0;
  std::vector<std::array<std::uint64_t, 4>> rows;
};

Stamp make_stamp(const Island& island, double scale, bool turned) {
  Stamp stamp;
  const auto place = [&](int i) {
    const glm::dvec2 p = island.uv[i] * island.density * scale * static_cast<double>(kGrid);
    return (turned ? glm::dvec2{p.y, p.x} : p) + 1.0;
  };
  glm::dvec2 high{0.0};
  for (std::size_t i = 0; i < island.uv.size(); ++i)
    high = glm::max(high, place(static_cast<int>(i)));
  stamp.width = static_cast<int>(std::ceil(high.x)) + 1;
  stamp.height = static_cast<int>(std::ceil(high.y)) + 1;
  if (stamp.width > kGrid || stamp.height > kGrid) return stamp;
  stamp.rows.assign(stamp.height, {0, 0, 0, 0});
  for (const auto& t : island.triangles) {
    const glm::dvec2 p[3] = {place(t[0]), place(t[1]), place(t[2])};
    const int x0 = std::max(0, static_cast<int>(std::min({p[0].x, p[1].x, p[2].x}) - 0.6));
    const int x1 =
        std::min(stamp.width - 1, static_cast<int>(std::max({p[0].x, p[1].x, p[2].x}) + 0.6));
    const int y0 = std::max(0, static_cast<int>(std::min({p[0].y, p[1].y, p[2].y}) - 0.6));
    const int y1 =
        std::min(stamp.height - 1, static_cast<int>(std::max({p[0].y, p[1].y, p[2].y}) + 0.6));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) stamp.rows[y][x / 64] |= 1ULL << (x % 64);
    }
  }
  return stamp;
}

bool collides(const Stamp& stamp, const std::vector<std::array<std::uint64_t, 4>>& field, int x,
              int y) {
  const int word = x / 64, bit = x % 64;
  for (int r = 0; r < stamp.height; ++r) {
    const auto& row = field[y + r];
    for (int w = 0; w * 64 < stamp.width; ++w) {
      const std::uint64_t cells = stamp.rows[r][w];
      if (cells == 0) continue;
      if (w + word < 4 && (row[w + word] & (cells << bit)) != 0) return true;
      if (bit != 0 && w + word + 1 < 4 && (row[w + word + 1] & (cells >> (64 - bit))) != 0)
        return true;
    }
  }
  return false;
}

struct Placement {
  int x = 0, y = 0;
  bool turned = false;
};

bool pack(const std::vector<Island>& islands, const std::vector<int>& order, double scale,
          std::vector<Placement>& out) {
  std::vector<std::array<std::uint64_t, 4>> field(kGrid, {0, 0, 0, 0});
  out.assign(islands.size(), {});
  for (const int i : order) {
    Placement best;
    int best_cost = 1 << 30;
    Stamp chosen;
    for (const bool turned : {false, true}) {
      const Stamp stamp = make_stamp(islands[i], scale, turned);
      if (stamp.width > kGrid || stamp.height > kGrid) continue;
      for (int y = 0; y + stamp.height <= kGrid; ++y) {
        if (y + stamp.height >= best_cost) break;
        bool found = false;
        for (int x = 0; x + stamp.width <= kGrid; ++x) {
          if (collides(stamp, field, x, y)) continue;
          const int cost = y + stamp.height;
          if (cost < best_cost) {
            best_cost = cost;
            best = {x, y, turned};
            chosen = stamp;
          }
          found = true;
          break;
        }
        if (found) break;
      }
    }
    if (best_cost == 1 << 30) return false;
    out[i] = best;
    for (int r = 0; r < chosen.height; ++r) {
      for (int x = 0; x < chosen.width; ++x) {
        if ((chosen.rows[r][x / 64] >> (x % 64) & 1) != 0) {
          const int fx = best.x + x;
          field[best.y + r][fx / 64] |= 1ULL << (fx % 64);
        }
      }
    }
  }
  return true;
}

/// Numbers the wedges again with the slits and draws the two sides of each slit apart by a hair.
Unwrap open_slits(const Mesh& mesh, const Topology& closed, const std::vector<glm::vec2>& flat) {
  constexpr float kHalfGap = 0.8F / 2048.0F;
  const Topology open(mesh);
  Unwrap out;
  out.uv.resize(open.wedge_count);
  out.corner.resize(mesh.faces.size());
  std::vector<int> sides(closed.wedge_count, 0), parent(open.wedge_count, -1);
  std::vector<glm::vec2> inwards(open.wedge_count, glm::vec2{0.0F});
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const glm::vec2 p[3] = {flat[closed.wedge[f][0]], flat[closed.wedge[f][1]],
                            flat[closed.wedge[f][2]]};
    for (int i = 0; i < 3; ++i) {
      const int w = open.wedge[f][i];
      out.corner[f][i] = w;
      out.uv[w] = p[i];
      if (parent[w] < 0) ++sides[closed.wedge[f][i]];
      parent[w] = closed.wedge[f][i];
      const glm::vec2 e = (p[0] + p[1] + p[2]) / 3.0F - p[i];
      inwards[w] += e / std::max(1e-9F, glm::length(e));
    }
  }
  std::vector<float> gap(open.wedge_count, 0.0F);
  for (int w = 0; w < open.wedge_count; ++w) {
    if (sides[parent[w]] > 1 && glm::length(inwards[w]) > 1e-6F) gap[w] = kHalfGap;
  }
  // narrow triangles get a narrower gap
  for (int round = 0; round < 6; ++round) {
    const auto place = [&](int w) {
      return gap[w] > 0.0F ? flat[parent[w]] + glm::normalize(inwards[w]) * gap[w]
                           : flat[parent[w]];
    };
    bool changed = false;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      glm::vec2 before[3], after[3];
      for (int i = 0; i < 3; ++i) {
        before[i] = flat[parent[out.corner[f][i]]];
        after[i] = place(out.corner[f][i]);
      }
      const auto area = [](const glm::vec2* q) {
        return (q[1].x - q[0].x) * (q[2].y - q[0].y) - (q[1].y - q[0].y) * (q[2].x - q[0].x);
      };
      if (area(after) * area(before) > 0.3F * area(before) * area(before)) continue;
      for (int i = 0; i < 3; ++i) gap[out.corner[f][i]] *= 0.5F;
      changed = true;
    }
    if (!changed) break;
  }
  for (int w = 0; w < open.wedge_count; ++w) {
    if (gap[w] > 0.0F) out.uv[w] = flat[parent[w]] + glm::normalize(inwards[w]) * gap[w];
  }
  return out;
}

}  // namespace

int count_wedges(const Mesh& mesh) { return Topology(mesh).wedge_count; }

void cut_to_discs(Mesh& mesh) {
  for (int attempt = 0; attempt < 32; ++attempt) {
    const Topology topology(mesh);
    const auto borders = topology.borders(mesh);
    bool changed = false;
    for (int c = 0; c < topology.component_count; ++c) {
      if (borders[c].size() < 2) continue;
      // breadth first from the longest border to any other
      std::size_t longest = 0;
      for (std::size_t i = 1; i < borders[c].size(); ++i) {
        if (borders[c][i].size() > borders[c][longest].size()) longest = i;
      }
      std::map<int, std::vector<int>> near;  // wedge graph of the component, inner edges only
      for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        if (topology.component[f] != c) continue;
        const MeshFace& face = mesh.faces[f];
        for (int i = 0; i < face.size(); ++i) {
          const int j = (i + 1) % face.size();
          if (topology.is_seam(mesh, static_cast<int>(f), face.corner[i], face.corner[j])) continue;
          near[topology.wedge[f][i]].push_back(topology.wedge[f][j]);
          near[topology.wedge[f][j]].push_back(topology.wedge[f][i]);
        }
      }
      std::map<int, int> from;
      std::deque<int> queue;
      std::map<int, bool> goal;
      for (std::size_t i = 0; i < borders[c].size(); ++i) {
        for (const int w : borders[c][i]) {
          if (i == longest) {
            from[w] = w;
            queue.push_back(w);
          } else {
            goal[w] = true;
          }
        }
      }
      while (!queue.empty()) {
        const int w = queue.front();
        queue.pop_front();
        if (goal.count(w) > 0) {
          for (int at = w; from[at] != at; at = from[at]) {
            mesh.cut(topology.wedge_vertex[at], topology.wedge_vertex[from[at]]);
          }
          changed = true;
          break;
        }
        for (const int other : near[w]) {
          if (from.count(other) == 0) {
            from[other] = w;
            queue.push_back(other);
          }
        }
      }
      if (changed) break;
    }
    if (!changed) return;
  }
}

void add_slits(Mesh& mesh, const std::vector<std::vector<int>>& slits, int wedge_count) {
  const Topology topology(mesh);
  int missing = wedge_count - topology.wedge_count;
  std::vector<char> on_seam(mesh.vertices.size(), 0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const MeshFace& face = mesh.faces[f];
    for (int i = 0; i < face.size(); ++i) {
      const int a = face.corner[i], b = face.corner[(i + 1) % face.size()];
      if (topology.is_seam(mesh, static_cast<int>(f), a, b)) on_seam[a] = on_seam[b] = 1;
    }
  }
  const auto extend = [&](int a, int b) {
    const auto edge = topology.face_of.find(edge_key(a, b));
    if (edge == topology.face_of.end() || on_seam[a] == 0 || on_seam[b] != 0) return false;
    mesh.slit(a, b);
    on_seam[b] = 1;
    --missing;
    return true;
  };
  for (const std::vector<int>& path : slits) {
    for (std::size_t i = 1; i < path.size() && missing > 0; ++i) {
      if (!extend(path[i - 1], path[i]) && on_seam[path[i - 1]] != 0 && on_seam[path[i]] == 0)
        break;
    }
  }
  // what is left: short slits from seams into the larger charts, in vertex order
  for (int depth = 0; depth < 3 && missing > 0; ++depth) {
    for (std::size_t f = 0; f < mesh.faces.size() && missing > 0; f += 7) {
      const MeshFace& face = mesh.faces[f];
      if (face.region == Region::kSkin) continue;
      for (int i = 0; i < face.size() && missing > 0; ++i) {
        if (extend(face.corner[i], face.corner[(i + 1) % face.size()])) break;
      }
    }
  }
}

Unwrap unwrap(const Mesh& mesh, const std::vector<glm::vec3>& position,
              const std::vector<float>& density) {
  const Topology topology(mesh, false);
  const auto borders = topology.borders(mesh);
  std::vector<Island> islands(topology.component_count);
  std::vector<std::unordered_map<int, int>> local(topology.component_count);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const int c = topology.component[f];
    Island& island = islands[c];
    std::array<int, 3> t{};
    glm::dvec3 p[3];
    for (int i = 0; i < 3; ++i) {
      const int w = topology.wedge[f][i];
      const auto [found, is_new] = local[c].try_emplace(w, static_cast<int>(island.wedges.size()));
      if (is_new) island.wedges.push_back(w);
      t[i] = found->second;
      p[i] = position[mesh.faces[f].corner[i]];
    }
    island.triangles.push_back(t);
    island.density = density[mesh.faces[f].chart];
    const glm::dvec3 e1 = p[1] - p[0], e2 = p[2] - p[0];
    const double l1 = std::max(1e-6, glm::length(e1));
    const double x = glm::dot(e2, e1) / l1;
    const double y = std::max(1e-5, glm::length(glm::cross(e1, e2)) / l1);
    island.rest.push_back({glm::dvec2{0, 0}, glm::dvec2{l1, 0}, glm::dvec2{x, y}});
  }
  for (int c = 0; c < topology.component_count; ++c) {
    std::vector<int> border;
    for (const int w : borders[c].front()) border.push_back(local[c].at(w));
    embed(islands[c], border);
    flatten(islands[c]);
    straighten(islands[c]);
  }
  // large ones first
  std::vector<int> order(islands.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<double> area(islands.size(), 0.0);
  for (std::size_t i = 0; i < islands.size(); ++i) {
    glm::dvec2 high{0.0};
    for (const glm::dvec2& p : islands[i].uv) high = glm::max(high, p);
    area[i] = high.x * high.y * islands[i].density * islands[i].density;
  }
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return area[a] > area[b]; });
  std::vector<Placement> places, trial;
  double low = 0.02, high = 2.0;
  for (int round = 0; round < 9; ++round) {
    const double middle = round == 0 ? 0.35 : std::sqrt(low * high);
    if (pack(islands, order, middle, trial)) {
      low = middle;
      places = trial;
    } else {
      high = middle;
    }
  }
  if (places.empty()) {
    low = 0.02;
    pack(islands, order, low, places);
  }
  std::vector<glm::vec2> flat(topology.wedge_count);
  for (std::size_t i = 0; i < islands.size(); ++i) {
    for (std::size_t k = 0; k < islands[i].wedges.size(); ++k) {
      const glm::dvec2 p = islands[i].uv[k] * islands[i].density * low;
      const glm::dvec2 q =
          (places[i].turned ? glm::dvec2{p.y, p.x} : p) +
          (glm::dvec2{places[i].x, places[i].y} + 1.0) / static_cast<double>(kGrid);
      flat[islands[i].wedges[k]] = glm::clamp(glm::vec2(q), glm::vec2(0.0F), glm::vec2(1.0F));
    }
  }
  return open_slits(mesh, topology, flat);
}

}  // namespace throng::builtin
