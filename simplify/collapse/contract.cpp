#include "simplify/collapse/contract.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

namespace throng::simplify {
namespace {

// What the cost of a collapse (m^4 over the size squared) counts beside the pictures.
constexpr float kGeometry = 1.0F;
constexpr float kWorstPose = 0.35F;
// Points of other pieces within this share of the size may merge; so many of them for each point.
constexpr float kNearPiece = 0.08F;
constexpr std::size_t kNearCount = 3;
// A piece of so many points may vanish as a whole.
constexpr std::size_t kSmallPiece = 16;
constexpr int kMostTries = 24;  // pictures looked at for one step
// Limbs count beyond their pixels where so few vertices are left that they would go.
constexpr float kThinFrom = 192.0F, kThinTo = 64.0F;
// Levels of so many vertices, or of a share of all, will have colours of their own, whatever their
// texture coordinates.
constexpr std::uint32_t kToned = 256, kTonedShare = 4;
// Where the colours of a triangle are compared.
constexpr glm::vec3 kColorPlaces[] = {
    {0.34F, 0.33F, 0.33F}, {0.6F, 0.2F, 0.2F},   {0.2F, 0.6F, 0.2F},  {0.2F, 0.2F, 0.6F},
    {0.45F, 0.45F, 0.1F},  {0.1F, 0.45F, 0.45F}, {0.45F, 0.1F, 0.45F}};
// So many ways are tried from so many vertices on, with costs raised by up to this share.
constexpr std::uint32_t kTries = 8, kTriesFrom = 112;
constexpr float kNoise = 1.0F;
// What a piece counts that vanishes as a whole: pictures are small, and it is missed.
constexpr float kWhole = 3.0F;
constexpr float kUnknown = -1.0e30F;

struct Pair {
  std::uint32_t a, b;  // a goes
  float geometry = 0.0F;
  float seen = kUnknown;  // change of the pictures, as far as known
  float won = 1.0F;       // share of the cost, for the wedges that go
  bool is_possible = false;
  bool by_color = false;  // its wedges go where colours fit best

  float key() const { return ((seen == kUnknown ? 0.0F : seen) + geometry) * won; }
};

/// The part of the full surface that a point stands for.
struct Patch {
  glm::vec3 color{0.0F};  // times the area
  float area_m2 = 0.0F;

  Patch operator+(const Patch& other) const {
    return {color + other.color, area_m2 + other.area_m2};
  }
  glm::vec3 mean() const { return area_m2 > 0.0F ? color / area_m2 : glm::vec3(0.5F); }
};

/// 0 to 1, by a seed and two points (SplitMix64's mixer).
float chance(std::uint32_t seed, std::uint32_t a, std::uint32_t b) {
  std::uint64_t x = (std::uint64_t{seed} << 48U) ^ (std::uint64_t{a} << 24U) ^ b;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return static_cast<float>((x ^ (x >> 31U)) >> 40U) / 16777216.0F;
}

class Contraction {
 public:
  Contraction(float size_m, PoseCost& poses, const AttributeCost& attributes, Views& views,
              float& error_m, WedgeMesh& mesh, std::uint32_t seed = 0)
      : size_m_(size_m),
        seed_(seed),
        poses_(poses),
        attributes_(attributes),
        views_(views),
        error_m_(error_m),
        mesh_(mesh),
        around_(mesh.surface().points.size()),
        piece_(mesh.surface().points.size(), kNoIndex),
        patch_(mesh.surface().points.size()),
        is_dirty_(mesh.surface().points.size(), true) {}

  /// @param most_error  gives up where `error` is larger
  void run(std::uint32_t coarsest_count, const std::function<void(float)>& on_progress,
           float most_error = std::numeric_limits<float>::max()) {
    look();
    find_patches();
    find_pairs();
    const auto first = static_cast<float>(mesh_.alive_wedges() - coarsest_count);
    for (int steps = 1; mesh_.alive_wedges() > coarsest_count && error_ < most_error; ++steps) {
      const auto before = static_cast<float>(mesh_.alive_wedges());
      if (!step()) break;
      look();
      // levels count by the ratio of their vertices
      error_ += views_.error() * std::log(before / static_cast<float>(mesh_.alive_wedges()));
      if (on_progress && steps % 16 == 0 && mesh_.alive_wedges() > coarsest_count)
        on_progress(1.0F - static_cast<float>(mesh_.alive_wedges() - coarsest_count) / first);
    }
  }

  /// Of the pictures, over the levels of `run`.
  float error() const { return error_; }

 private:
  /// What a pair costs in this variant.
  float key(const Pair& pair) const {
    if (seed_ == 0) return pair.key();
    return pair.key() * (1.0F + kNoise * chance(seed_, pair.a, pair.b));
  }

  bool is_toned() const {
    return mesh_.alive_wedges() <= toned_count(mesh_.surface().wedge_count());
  }

  /// Lists what is alive.
  void look() {
    drawn_.clear();
    triangle_.clear();
    for (const std::uint32_t point : alive_) around_[point].clear();
    alive_.clear();
    for (std::uint32_t t = 0; t < mesh_.surface().triangles.size(); ++t) {
      if (!mesh_.is_alive(t)) continue;
      const auto index = static_cast<std::uint32_t>(triangle_.size());
      triangle_.push_back(t);
      drawn_.push_back({mesh_.points(t), mesh_.wedges(t), mesh_.surface().triangle_flags[t]});
      for (int i = 0; i < 3; ++i) {
        std::vector<std::uint32_t>& around = around_[mesh_.points(t)[i]];
        if (around.empty()) alive_.push_back(mesh_.points(t)[i]);
        around.push_back(index);
      }
    }
    is_removed_.assign(triangle_.size(), false);
    const auto alive = static_cast<float>(mesh_.alive_wedges());
    views_.set(drawn_, std::clamp((kThinFrom - alive) / (kThinFrom - kThinTo), 0.0F, 1.0F),
               is_toned());
    find_pieces();
  }

  void find_pieces() {
    pieces_.clear();
    for (const std::uint32_t point : alive_) piece_[point] = kNoIndex;
    std::vector<std::uint32_t> stack;
    for (const std::uint32_t first : alive_) {
      if (piece_[first] != kNoIndex) continue;
      const auto number = static_cast<std::uint32_t>(pieces_.size());
      pieces_.emplace_back();
      piece_[first] = number;
      stack.push_back(first);
      while (!stack.empty()) {
        const std::uint32_t point = stack.back();
        stack.pop_back();
        pieces_.back().push_back(point);
        for (const std::uint32_t index : around_[point]) {
          for (int i = 0; i < 3; ++i) {
            const std::uint32_t other = drawn_[index].point[i];
            if (piece_[other] != kNoIndex) continue;
            piece_[other] = number;
            stack.push_back(other);
          }
        }
      }
    }
  }

  void find_pairs() {
    for (const Views::Drawn& drawn : drawn_) {
      for (int i = 0; i < 3; ++i) {
        pairs_.push_back({drawn.point[i], drawn.point[(i + 1) % 3]});
        pairs_.push_back({drawn.point[(i + 1) % 3], drawn.point[i]});
      }
    }
    const auto& points = mesh_.surface().points;
    std::vector<std::pair<float, std::uint32_t>> near;
    for (const std::uint32_t a : alive_) {
      near.clear();
      for (const std::uint32_t b : alive_) {
        const glm::vec3 away = points[b].position - points[a].position;
        const float squared = glm::dot(away, away);
        if (piece_[a] != piece_[b] && squared < kNearPiece * kNearPiece * size_m_ * size_m_)
          near.emplace_back(squared, b);
      }
      const std::size_t count = std::min(near.size(), kNearCount);
      std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count),
                        near.end());
      for (std::size_t i = 0; i < count; ++i) {
        pairs_.push_back({a, near[i].second});
        pairs_.push_back({near[i].second, a});
      }
    }
    tidy_pairs();
  }

  void tidy_pairs() {
    std::sort(pairs_.begin(), pairs_.end(),
              [](const Pair& x, const Pair& y) { return std::tie(x.a, x.b) < std::tie(y.a, y.b); });
    const auto end = std::unique(pairs_.begin(), pairs_.end(), [](const Pair& x, const Pair& y) {
      return x.a == y.a && x.b == y.b;
    });
    pairs_.erase(end, pairs_.end());
    std::erase_if(pairs_, [&](const Pair& pair) {
      return pair.a == pair.b || around_[pair.a].empty() || around_[pair.b].empty();
    });
  }

  std::vector<std::uint32_t> triangles_of(std::uint32_t point) const {
    std::vector<std::uint32_t> list;
    for (const std::uint32_t index : around_[point]) list.push_back(triangle_[index]);
    return list;
  }

  /// Fills `moves_`. By colour, a wedge may leave its chart for any wedge of b.
  /// @return false where colours would change nothing
  bool find_moves(std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> around,
                  bool by_color) {
    mesh_.find_moves(a, b, around, moves_);
    if (!by_color) return true;
    bool is_changed = false;
    const Patch both = patch_[a] + patch_[b];
    for (WedgeMove& move : moves_) {
      float least = cost_of_color(a, b, around, move.from, move.to, both);
      for (const std::uint32_t other : mesh_.point_wedges(b)) {
        if (other == move.to) continue;
        const float cost = cost_of_color(a, b, around, move.from, other, both);
        if (cost >= least) continue;
        least = cost;
        move.to = other;
        move.is_exact = false;
        is_changed = true;
      }
    }
    return is_changed;
  }

  /// How much the colours of the triangles whose wedge `from` of point a becomes `to` of point b
  /// would differ from those that their corners stand for: areas times squared differences.
  float cost_of_color(std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> around,
                      std::uint32_t from, std::uint32_t to, const Patch& both) const {
    const Surface& surface = mesh_.surface();
    float cost = 0.0F;
    for (const std::uint32_t triangle : around) {
      if (mesh_.has(triangle, b)) continue;
      glm::uvec3 points = mesh_.points(triangle), wedges = mesh_.wedges(triangle);
      const int corner = points.x == a ? 0 : points.y == a ? 1 : 2;
      if (wedges[corner] != from) continue;
      points[corner] = b;
      wedges[corner] = to;
      glm::vec3 wanted[3], place[3];
      glm::vec2 uv[3];
      for (int i = 0; i < 3; ++i) {
        wanted[i] = (i == corner ? both : patch_[points[i]]).mean();
        place[i] = surface.points[points[i]].position;
        uv[i] = surface.wedge_uv[wedges[i]];
      }
      const float area_m2 =
          0.5F * glm::length(glm::cross(place[1] - place[0], place[2] - place[0]));
      for (const glm::vec3& share : kColorPlaces) {
        const glm::vec3 off =
            attributes_.color_at(share.x * uv[0] + share.y * uv[1] + share.z * uv[2]) -
            (share.x * wanted[0] + share.y * wanted[1] + share.z * wanted[2]);
        cost += area_m2 * glm::dot(off, off);
      }
    }
    return cost;
  }

  /// What each point stands for, after all that went before.
  void find_patches() {
    const Surface& surface = mesh_.surface();
    std::vector<std::uint32_t> target(surface.wedge_count());
    std::iota(target.begin(), target.end(), 0U);
    for (auto removal = mesh_.removals().rbegin(); removal != mesh_.removals().rend(); ++removal)
      target[removal->wedge] = target[removal->target];  // which went later, or never
    for (const glm::uvec3& wedges : surface.triangles) {
      const auto place = [&](int i) {
        return surface.points[surface.wedge_point[wedges[i]]].position;
      };
      const auto uv = [&](int i) { return surface.wedge_uv[wedges[i]]; };
      const float area_m2 =
          0.5F * glm::length(glm::cross(place(1) - place(0), place(2) - place(0)));
      for (int i = 0; i < 3; ++i) {
        const glm::vec3 color =
            attributes_.color_at(0.6F * uv(i) + 0.2F * uv((i + 1) % 3) + 0.2F * uv((i + 2) % 3));
        Patch& patch = patch_[surface.wedge_point[target[wedges[i]]]];
        patch = patch + Patch{area_m2 * color, area_m2};
      }
    }
  }

  void judge(Pair& pair) {
    pair.seen = kUnknown;
    // something of it must stay
    const auto stays = [&](std::uint32_t point) {
      return std::any_of(around_[point].begin(), around_[point].end(), [&](std::uint32_t index) {
        return !mesh_.has(triangle_[index], pair.a) || !mesh_.has(triangle_[index], pair.b);
      });
    };
    pair.is_possible =
        !around_[pair.a].empty() && !around_[pair.b].empty() && (stays(pair.a) || stays(pair.b));
    if (!pair.is_possible) return;
    const std::vector<std::uint32_t> around = triangles_of(pair.a);
    mesh_.find_moves(pair.a, pair.b, around, moves_);
    const PoseCost::Cost cost = poses_.move_cost(pair.a, pair.b);
    float geometry = (1.0F - kWorstPose) * cost.mean + kWorstPose * cost.largest +
                     poses_.extent_cost(pair.a, pair.b, true) +
                     poses_.area_m2(pair.a) * attributes_.joint_cost(pair.a, pair.b);
    for (const std::uint32_t triangle : around) {
      if (is_toned() || mesh_.has(triangle, pair.b)) continue;
      const glm::uvec3& points = mesh_.points(triangle);
      const std::uint32_t wedge = mesh_.wedges(triangle)[points.x == pair.a   ? 0
                                                         : points.y == pair.a ? 1
                                                                              : 2];
      for (const WedgeMove& move : moves_) {
        if (move.from == wedge)
          geometry += attributes_.triangle_cost(triangle, pair.a, pair.b, move);
      }
    }
    pair.geometry = kGeometry * geometry / (size_m_ * size_m_);
    pair.won = 1.0F / static_cast<float>(std::max(1U, mesh_.alive_wedges(pair.a)));
  }

  /// Change of the pictures by a contraction, in the charts or by colour, whichever is less.
  float look_at(Pair& pair, float limit) {
    const std::vector<std::uint32_t> around = triangles_of(pair.a);
    find_moves(pair.a, pair.b, around, false);
    pair.by_color = false;
    const float in_charts = try_moves(pair, limit);
    if (is_toned() || !find_moves(pair.a, pair.b, around, true)) return in_charts;
    const float by_color = try_moves(pair, std::min(limit, in_charts));
    pair.by_color = by_color < in_charts;
    return std::min(by_color, in_charts);
  }

  float try_moves(const Pair& pair, float limit) {
    const std::vector<std::uint32_t>& changed = around_[pair.a];
    saved_.clear();
    for (const std::uint32_t index : changed) {
      Views::Drawn& drawn = drawn_[index];
      saved_.push_back(drawn);
      if (mesh_.has(triangle_[index], pair.b)) {
        is_removed_[index] = true;
        continue;
      }
      for (int i = 0; i < 3; ++i) {
        if (drawn.point[i] != pair.a) continue;
        drawn.point[i] = pair.b;
        for (const WedgeMove& move : moves_) {
          if (move.from == saved_.back().wedge[i]) drawn.wedge[i] = move.to;
        }
      }
    }
    const float change = views_.change(drawn_, changed, is_removed_, limit);
    for (std::size_t i = 0; i < changed.size(); ++i) {
      drawn_[changed[i]] = saved_[i];
      is_removed_[changed[i]] = false;
    }
    return change;
  }

  std::vector<std::uint32_t> triangles_of_piece(std::uint32_t piece) const {
    std::vector<std::uint32_t> list;  // indices of what is drawn
    for (std::uint32_t i = 0; i < drawn_.size(); ++i) {
      if (piece_[drawn_[i].point.x] == piece) list.push_back(i);
    }
    return list;
  }

  /// Cheapest piece to vanish, and what it costs for each wedge that goes.
  std::pair<std::uint32_t, float> cheapest_piece() {
    std::pair<std::uint32_t, float> best{kNoIndex, std::numeric_limits<float>::max()};
    if (pieces_.size() < 2) return best;
    for (std::uint32_t piece = 0; piece < pieces_.size(); ++piece) {
      if (pieces_[piece].size() > kSmallPiece) continue;
      const std::vector<std::uint32_t> list = triangles_of_piece(piece);
      std::uint32_t wedges = 0;
      for (const std::uint32_t point : pieces_[piece]) wedges += mesh_.alive_wedges(point);
      for (const std::uint32_t index : list) is_removed_[index] = true;
      const float limit = best.second / kWhole * static_cast<float>(wedges);
      const float cost = kWhole * views_.change(drawn_, list, is_removed_, limit) /
                         static_cast<float>(std::max(1U, wedges));
      for (const std::uint32_t index : list) is_removed_[index] = false;
      if (cost < best.second) best = {piece, cost};
    }
    return best;
  }

  bool step() {
    if (is_toned() && !was_toned_) {  // costs are others from now on
      was_toned_ = true;
      for (const std::uint32_t point : alive_) is_dirty_[point] = true;
    }
    for (Pair& pair : pairs_) {
      if (is_dirty_[pair.a] || is_dirty_[pair.b]) judge(pair);
    }
    for (const std::uint32_t point : alive_) is_dirty_[point] = false;
    std::erase_if(pairs_, [](const Pair& pair) { return !pair.is_possible; });

    // The cheapest by what is known; it is chosen when a look at the pictures doesn't change that.
    Pair* best = nullptr;
    float best_cost = std::numeric_limits<float>::max();
    order_.resize(pairs_.size());
    for (std::size_t i = 0; i < pairs_.size(); ++i) order_[i] = {key(pairs_[i]), i};
    const std::size_t tries = std::min<std::size_t>(kMostTries, order_.size());
    std::partial_sort(order_.begin(), order_.begin() + static_cast<std::ptrdiff_t>(tries),
                      order_.end());
    for (std::size_t i = 0; i < tries; ++i) {
      Pair& pair = pairs_[order_[i].second];
      if (order_[i].first >= best_cost) break;
      pair.seen = look_at(pair, best_cost / pair.won);
      if (key(pair) < best_cost) {
        best = &pair;
        best_cost = key(pair);
      }
    }
    const auto [piece, piece_cost] = cheapest_piece();
    if (piece != kNoIndex && piece_cost < best_cost) {
      remove(piece);
      return true;
    }
    if (best == nullptr) return false;
    merge(best->a, best->b, best->by_color);
    return true;
  }

  void merge(std::uint32_t a, std::uint32_t b, bool by_color) {
    const std::vector<std::uint32_t> around = triangles_of(a);
    find_moves(a, b, around, by_color);
    const PoseCost::Cost cost = poses_.move_cost(a, b);
    if (poses_.area_m2(a) > 0.0F)
      error_m_ = std::max(error_m_, std::sqrt(cost.largest / poses_.area_m2(a)));
    for (const std::uint32_t point : {a, b}) {
      for (const std::uint32_t index : around_[point]) {
        for (int i = 0; i < 3; ++i) is_dirty_[drawn_[index].point[i]] = true;
      }
    }
    mesh_.collapse(a, b, around, moves_, error_m_);
    poses_.merge(a, b);
    patch_[b] = patch_[a] + patch_[b];
    for (Pair& pair : pairs_) {
      if (pair.a == a) pair.a = b;
      if (pair.b == a) pair.b = b;
    }
    // `around_` still tells of the time before; what has gone is dropped when it is judged
    around_[a].clear();
    tidy_pairs();
  }

  void remove(std::uint32_t piece) {
    const std::vector<std::uint32_t> list = triangles_of_piece(piece);
    std::vector<std::uint32_t> triangles;
    for (const std::uint32_t index : list) triangles.push_back(triangle_[index]);
    const auto& points = mesh_.surface().points;
    const glm::vec3 from = points[pieces_[piece].front()].position;
    float least = std::numeric_limits<float>::max();
    std::uint32_t target = kNoIndex;
    for (const Views::Drawn& drawn : drawn_) {
      const glm::vec3 away = points[drawn.point.x].position - from;
      if (piece_[drawn.point.x] == piece || glm::dot(away, away) >= least) continue;
      least = glm::dot(away, away);
      target = drawn.wedge.x;
    }
    mesh_.remove(triangles, target, error_m_);
    for (const std::uint32_t point : pieces_[piece]) around_[point].clear();
    tidy_pairs();
  }

  float size_m_;
  std::uint32_t seed_;  // 0: the cheapest is always chosen
  float error_ = 0.0F;
  PoseCost& poses_;
  const AttributeCost& attributes_;
  Views& views_;
  float& error_m_;
  WedgeMesh& mesh_;
  std::vector<std::uint32_t> alive_;                // points
  std::vector<std::uint32_t> triangle_;             // alive ones
  std::vector<Views::Drawn> drawn_;                 // as they are, same order
  std::vector<bool> is_removed_;                    // while a change is tried
  std::vector<std::vector<std::uint32_t>> around_;  // [P] into `triangle_`
  std::vector<std::uint32_t> piece_;                // [P]
  std::vector<std::vector<std::uint32_t>> pieces_;  // points
  std::vector<Patch> patch_;                        // [P]
  std::vector<Pair> pairs_;
  std::vector<bool> is_dirty_;  // [P]
  bool was_toned_ = false;
  std::vector<std::pair<float, std::size_t>> order_;
  std::vector<WedgeMove> moves_;
  std::vector<Views::Drawn> saved_;
};

}  // namespace

std::uint32_t toned_count(std::uint32_t wedge_count) {
  return std::min(kToned, wedge_count / kTonedShare);
}

void contract(std::uint32_t coarsest_count, float size_m, PoseCost& poses,
              const AttributeCost& attributes, Views& views, float& error_m, WedgeMesh& mesh,
              const std::function<void(float)>& on_progress) {
  Contraction(size_m, poses, attributes, views, error_m, mesh)
      .run(std::max(coarsest_count, std::min(kTriesFrom, mesh.alive_wedges())), on_progress);
  const WedgeMesh first_mesh = mesh;
  const PoseCost first_poses = poses;
  const float first_error_m = error_m;
  std::pair least{first_mesh.alive_wedges(), std::numeric_limits<float>::max()};
  for (std::uint32_t i = 0; i < kTries && first_mesh.alive_wedges() > coarsest_count; ++i) {
    // greedy choices lead into dead ends; others that are nearly as good lead elsewhere
    WedgeMesh own_mesh = first_mesh;
    PoseCost own_poses = first_poses;
    float own_error_m = first_error_m;
    Contraction own(size_m, own_poses, attributes, views, own_error_m, own_mesh, i);
    own.run(coarsest_count, nullptr, least.second);
    const std::pair result{std::max(coarsest_count, own_mesh.alive_wedges()), own.error()};
    if (result >= least) continue;
    least = result;
    mesh = std::move(own_mesh);
    error_m = own_error_m;
  }
}

}  // namespace throng::simplify
