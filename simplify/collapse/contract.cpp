#include "simplify/collapse/contract.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <mutex>
#include <numeric>
#include <optional>
#include <queue>
#include <thread>
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
// Levels of at most so many vertices have colours of their own if they look better with them, and
// from the second number on in any case; of a small mesh from a quarter of it on. Asked again after
// each fifth.
constexpr std::uint32_t kToned = 256, kSurelyToned = 112, kTonedShare = 4;
constexpr float kAskAgain = 0.8F;
// Where the colours of a triangle are compared.
constexpr glm::vec3 kColorPlaces[] = {
    {0.34F, 0.33F, 0.33F}, {0.6F, 0.2F, 0.2F},   {0.2F, 0.6F, 0.2F},  {0.2F, 0.2F, 0.6F},
    {0.45F, 0.45F, 0.1F},  {0.1F, 0.45F, 0.45F}, {0.45F, 0.1F, 0.45F}};
// So many ways are tried from so many vertices on, with costs raised by up to this share.
constexpr std::uint32_t kTries = 8, kTriesFrom = 112;
constexpr float kNoise = 1.0F;
// What a piece counts that vanishes as a whole: pictures are small, and it is missed.
constexpr float kWhole = 3.0F;
// Around a point and around its mirror image, within this share of the size, there should be as
// many vertices. Beyond this share of both, steps are cheaper on this side; not for the last
// vertices, where what is seen decides alone.
constexpr float kAround = 0.25F, kEven = 0.6F, kEvenStep = 16.0F;
constexpr std::uint32_t kEvenFrom = 96;
// What a triangle costs that spans from limb to limb, by its area and the squared detour, and how
// much longer than a straight line ways along a mesh are anyway.
constexpr float kBridge = 1.0F, kStraight = 2.0F;
constexpr float kUnknown = -1.0e30F;
constexpr float kTwins = 1.0e20F;  // the cost of two triangles at one place: the last choice

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

/// How far points are from each other along a mesh, for the points that are alive when it is made.
/// Of more than kMostPoints (pieces that could not be decimated) nothing is known.
class Walks {
 public:
  Walks(const WedgeMesh& mesh, std::span<const std::uint32_t> triangles)
      : row_(mesh.surface().points.size(), kNoIndex) {
    std::vector<std::vector<std::pair<std::uint32_t, float>>> next;
    const auto& points = mesh.surface().points;
    const auto row = [&](std::uint32_t point) {
      if (row_[point] == kNoIndex) {
        row_[point] = static_cast<std::uint32_t>(next.size());
        next.emplace_back();
      }
      return row_[point];
    };
    for (const std::uint32_t t : triangles) {
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t a = mesh.points(t)[i], b = mesh.points(t)[(i + 1) % 3];
        const float length_m = glm::distance(points[a].position, points[b].position);
        const std::uint32_t from = row(a), to = row(b);
        next[from].emplace_back(to, length_m);
        next[to].emplace_back(from, length_m);
      }
    }
    if (next.size() > kMostPoints) {
      row_.assign(row_.size(), kNoIndex);
      return;
    }
    count_ = next.size();
    length_m_.assign(count_ * count_, kNone);
    using Item = std::pair<float, std::uint32_t>;
    std::priority_queue<Item, std::vector<Item>, std::greater<>> queue;
    for (std::uint32_t start = 0; start < count_; ++start) {  // Dijkstra 1959
      float* length_m = &length_m_[start * count_];
      length_m[start] = 0.0F;
      queue.emplace(0.0F, start);
      while (!queue.empty()) {
        const auto [so_far, at] = queue.top();
        queue.pop();
        if (so_far > length_m[at]) continue;
        for (const auto& [to, step] : next[at]) {
          if (so_far + step >= length_m[to]) continue;
          length_m[to] = so_far + step;
          queue.emplace(length_m[to], to);
        }
      }
    }
  }

  /// By how much the way along the mesh is longer than `straight_m`; 0 between pieces.
  float detour_m(std::uint32_t a, std::uint32_t b, float straight_m) const {
    if (row_[a] == kNoIndex || row_[b] == kNoIndex) return 0.0F;
    const float length_m = length_m_[row_[a] * count_ + row_[b]];
    return length_m == kNone ? 0.0F : std::max(0.0F, length_m - kStraight * straight_m);
  }

 private:
  static constexpr float kNone = std::numeric_limits<float>::max();
  static constexpr std::size_t kMostPoints = 4096;  // 64 MiB
  std::vector<std::uint32_t> row_;                  // [P]
  std::size_t count_ = 0;
  std::vector<float> length_m_;  // [count][count]
};

class Contraction {
 public:
  Contraction(float size_m, const std::function<bool()>& prefers_tones, PoseCost& poses,
              const AttributeCost& attributes, std::span<const std::uint32_t> mirror,
              const Walks& walks, Views& views, float& error_m, WedgeMesh& mesh,
              std::uint32_t seed = 0)
      : size_m_(size_m),
        seed_(seed),
        is_two_sided_(mesh.surface().is_two_sided()),
        prefers_tones_(prefers_tones),
        poses_(poses),
        attributes_(attributes),
        views_(views),
        error_m_(error_m),
        mesh_(mesh),
        around_(mesh.surface().points.size()),
        piece_(mesh.surface().points.size(), kNoIndex),
        patch_(mesh.surface().points.size()),
        mirror_(mirror),
        walks_(walks),
        is_dirty_(mesh.surface().points.size(), true) {}

  /// @param most_error  gives up where `error` is larger
  void run(std::uint32_t coarsest_count, const std::function<void(float)>& on_progress,
           const std::atomic<float>* most_error = nullptr) {
    look();
    find_patches();
    find_pairs();
    const auto first = static_cast<float>(mesh_.alive_wedges() - coarsest_count);
    for (int steps = 1; mesh_.alive_wedges() > coarsest_count; ++steps) {
      if (most_error != nullptr && error_ > *most_error) break;
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
  /// 0 where no level was reached that has colours of its own.
  std::uint32_t toned_count() const { return toned_count_; }

 private:
  /// What a pair costs in this variant.
  float key(const Pair& pair) const {
    float key = pair.key();
    if (!evenness_.empty()) key *= key > 0.0F ? evenness_[pair.a] : 1.0F / evenness_[pair.a];
    if (seed_ == 0) return key;
    return key * (1.0F + kNoise * chance(seed_, pair.a, pair.b));
  }

  /// Fills `evenness_`: what steps cost for a point, so that no limb goes at the expense of the one
  /// on the other side.
  void look_for_balance() {
    if (mirror_.empty()) return;
    evenness_.assign(mirror_.size(), 1.0F);
    if (mesh_.alive_wedges() < kEvenFrom) return;
    const auto& points = mesh_.surface().points;
    const float most = kAround * kAround * size_m_ * size_m_;
    for (const std::uint32_t a : alive_) {
      const std::uint32_t c = mirror_[a];
      if (c == kNoIndex || c == a) continue;
      float here = 0.0F, there = 0.0F;
      for (const std::uint32_t p : alive_) {
        if (mirror_[p] == kNoIndex) continue;
        const auto wedges = static_cast<float>(mesh_.alive_wedges(p));
        const glm::vec3 to_a = points[p].position - points[a].position;
        const glm::vec3 to_c = points[p].position - points[c].position;
        if (glm::dot(to_a, to_a) < most) here += wedges;
        if (glm::dot(to_c, to_c) < most) there += wedges;
      }
      const float share = here / std::max(here + there, 1.0F);
      if (share > kEven) evenness_[a] = 1.0F / (1.0F + kEvenStep * (share - kEven));
    }
  }

  bool is_toned() const { return toned_count_ > 0; }

  void choose_tones() {
    const std::uint32_t most = mesh_.surface().wedge_count() / kTonedShare;
    const std::uint32_t alive = mesh_.alive_wedges();
    if (is_toned() || alive > std::min(ask_at_, most)) return;
    ask_at_ = static_cast<std::uint32_t>(kAskAgain * static_cast<float>(alive));
    if (alive <= std::min(kSurelyToned, most) || prefers_tones_()) toned_count_ = alive;
  }

  /// Lists what is alive.
  void look() {
    choose_tones();
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
    is_twin_.assign(triangle_.size(), false);
    const auto alive = static_cast<float>(mesh_.alive_wedges());
    views_.set(drawn_, std::clamp((kThinFrom - alive) / (kThinFrom - kThinTo), 0.0F, 1.0F),
               is_toned());
    find_pieces();
    look_for_balance();
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

  /// Of a triangle, m^4.
  float bridge_cost(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    const auto& points = mesh_.surface().points;
    const glm::vec3 ab = points[b].position - points[a].position;
    const glm::vec3 ac = points[c].position - points[a].position;
    const float detour_m =
        std::max({walks_.detour_m(a, b, glm::length(ab)), walks_.detour_m(a, c, glm::length(ac)),
                  walks_.detour_m(b, c, glm::length(ac - ab))});
    return kBridge * 0.5F * glm::length(glm::cross(ab, ac)) * detour_m * detour_m;
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
    for (const std::uint32_t triangle : around) {
      if (mesh_.alive_wedges() <= kTriesFrom) break;  // where what is seen decides alone
      const glm::uvec3& points = mesh_.points(triangle);
      const int corner = points.x == pair.a ? 0 : points.y == pair.a ? 1 : 2;
      const std::uint32_t x = points[(corner + 1) % 3], y = points[(corner + 2) % 3];
      geometry -= bridge_cost(pair.a, x, y);
      if (!mesh_.has(triangle, pair.b)) geometry += bridge_cost(pair.b, x, y);
    }
    pair.geometry = kGeometry * geometry / (size_m_ * size_m_);
    // where both sides are drawn one of two is enough; else it must stay, or the surface opens
    if (!is_two_sided_) {
      find_twins(pair.a, pair.b);
      if (!twins_.empty()) pair.geometry = kTwins;
    }
    pair.won = 1.0F / static_cast<float>(std::max(1U, mesh_.alive_wedges(pair.a)));
  }

  /// Fills `twins_` with those of a's triangles, as they are drawn, that would lie on another one
  /// and show the same side, or both: depth can't tell which is seen.
  void find_twins(std::uint32_t a, std::uint32_t b) {
    twins_.clear();
    const auto moved = [&](std::uint32_t index) {
      glm::uvec3 points = drawn_[index].point;
      for (int i = 0; i < 3; ++i) points[i] = points[i] == a ? b : points[i];
      return points;
    };
    const auto is_dying = [&](std::uint32_t index) {
      return mesh_.has(triangle_[index], a) && mesh_.has(triangle_[index], b);
    };
    for (const std::uint32_t index : around_[a]) {
      if (is_dying(index)) continue;
      const glm::uvec3 own = moved(index);
      const auto is_twin = [&](std::uint32_t other) {
        if (other == index || is_dying(other) || is_twin_[other]) return false;
        const glm::uvec3 p = moved(other);
        const int first = p.x == own.x ? 0 : p.y == own.x ? 1 : 2;
        const std::uint32_t second = p[(first + 1) % 3], third = p[(first + 2) % 3];
        return p[first] == own.x && ((second == own.y && third == own.z) ||
                                     (is_two_sided_ && second == own.z && third == own.y));
      };
      if (!std::any_of(around_[b].begin(), around_[b].end(), is_twin) &&
          !std::any_of(around_[a].begin(), around_[a].end(), is_twin))
        continue;
      twins_.push_back(index);
      is_twin_[index] = true;
    }
    for (const std::uint32_t index : twins_) is_twin_[index] = false;
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
    twins_.clear();
    if (is_two_sided_) find_twins(pair.a, pair.b);
    for (const std::uint32_t index : changed) {
      Views::Drawn& drawn = drawn_[index];
      saved_.push_back(drawn);
      if (mesh_.has(triangle_[index], pair.b) ||
          std::find(twins_.begin(), twins_.end(), index) != twins_.end()) {
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
    twins_.clear();
    if (is_two_sided_) find_twins(a, b);
    for (std::uint32_t& index : twins_) index = triangle_[index];
    mesh_.collapse(a, b, around, moves_, error_m_, twins_);
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
  bool is_two_sided_;
  const std::function<bool()>& prefers_tones_;
  std::uint32_t ask_at_ = kToned;
  std::uint32_t toned_count_ = 0;
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
  std::span<const std::uint32_t> mirror_;           // [P] or empty
  std::vector<float> evenness_;                     // [P] or empty
  const Walks& walks_;
  std::vector<Pair> pairs_;
  std::vector<bool> is_dirty_;  // [P]
  bool was_toned_ = false;
  std::vector<std::pair<float, std::size_t>> order_;
  std::vector<WedgeMove> moves_;
  std::vector<std::uint32_t> twins_;
  std::vector<bool> is_twin_;
  std::vector<Views::Drawn> saved_;
};

}  // namespace

std::uint32_t contract(std::uint32_t coarsest_count, float size_m, std::uint32_t threads,
                       const std::function<bool()>& prefers_tones, PoseCost& poses,
                       const AttributeCost& attributes, std::span<const std::uint32_t> mirror,
                       Views& views, float& error_m, WedgeMesh& mesh,
                       const std::function<void(float)>& on_progress) {
  std::vector<std::uint32_t> alive;
  for (std::uint32_t t = 0; t < mesh.surface().triangles.size(); ++t) {
    if (mesh.is_alive(t)) alive.push_back(t);
  }
  const Walks walks(mesh, alive);
  Contraction fine(size_m, prefers_tones, poses, attributes, mirror, walks, views, error_m, mesh);
  fine.run(std::max(coarsest_count, std::min(kTriesFrom, mesh.alive_wedges())), on_progress);
  if (mesh.alive_wedges() <= coarsest_count) return fine.toned_count();

  // greedy choices lead into dead ends; others that are nearly as good lead elsewhere
  struct Way {
    WedgeMesh mesh;
    float error_m;
    std::tuple<std::uint32_t, float, std::uint32_t> result;  // vertices left, error, number
    std::uint32_t toned_count;
  };
  std::optional<Way> best;
  std::atomic<float> most_error = std::numeric_limits<float>::max();
  std::atomic<std::uint32_t> next = 0;
  std::mutex mutex;
  const std::function<bool()> always = [] { return true; };
  const auto try_ways = [&](Views& own_views) {
    for (std::uint32_t i; (i = next.fetch_add(1)) < kTries;) {
      Way way{mesh, error_m, {}, 0};
      PoseCost own_poses = poses;
      Contraction own(size_m, always, own_poses, attributes, mirror, walks, own_views, way.error_m,
                      way.mesh, i);
      own.run(coarsest_count, nullptr, &most_error);
      way.result = {std::max(coarsest_count, way.mesh.alive_wedges()), own.error(), i};
      way.toned_count = own.toned_count();
      const std::lock_guard lock(mutex);
      if (best.has_value() && way.result >= best->result) continue;
      // one that is stuck must not stop others, which may come farther
      if (way.mesh.alive_wedges() <= coarsest_count) most_error = own.error();
      best = std::move(way);
    }
  };
  // memory that a thread runs out of is the caller's to tell
  std::exception_ptr failed;
  {
    std::vector<std::jthread> others;
    for (std::uint32_t i = 1; i < std::min(threads, kTries); ++i)
      others.emplace_back([&] {
        try {
          Views own_views = views;
          try_ways(own_views);
        } catch (const std::exception&) {
          next = kTries;
          const std::lock_guard lock(mutex);
          failed = std::current_exception();
        }
      });
    Views own_views = views;
    try_ways(own_views);
  }
  if (failed != nullptr) std::rethrow_exception(failed);
  mesh = std::move(best->mesh);
  error_m = best->error_m;
  return fine.toned_count() > 0 ? fine.toned_count() : best->toned_count;
}

}  // namespace throng::simplify
