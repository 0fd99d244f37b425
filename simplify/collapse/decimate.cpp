#include "simplify/collapse/decimate.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>

// OpenMesh's headers warn under our options.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModBaseT.hh>
#include <OpenMesh/Tools/Decimater/Observer.hh>
#pragma GCC diagnostic pop

#include "simplify/collapse/attribute_cost.hpp"
#include "simplify/collapse/contract.hpp"
#include "simplify/collapse/mirror.hpp"
#include "simplify/collapse/pose_cost.hpp"
#include "simplify/collapse/views.hpp"

namespace throng::simplify {
namespace {

using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<>;
using CollapseInfo = OpenMesh::Decimater::CollapseInfoT<HalfEdgeMesh>;

// Share of the worst pose in the cost; the rest of it is the mean over poses.
constexpr float kWorstPose = 0.35F;

/// What a phase refuses. The first one is strict; the others only run when it is stuck.
struct Phase {
  float least_cosine;
  float least_quality;
  bool bind_pose_only;
  bool may_mirror;
};
constexpr Phase kPhases[] = {
    {0.20F, 0.06F, false, false},
    {-0.10F, 0.02F, false, true},
    {-0.50F, 0.0F, true, true},
};
// Vertices at which the pictures take over, and at least this share of a small character.
constexpr std::uint32_t kContractCount = 512;
constexpr float kContractShare = 0.5F;
constexpr float kFineShare = 0.5F;  // of the time, for the progress shown
constexpr std::size_t kPhaseCount = std::size(kPhases);

/// What a budget buys is vertices, so a step may cost more if more of them go with it. By the
/// square root, not the number itself: seams would go too early.
float vertex_share(std::uint32_t wedges) {
  return 1.0F / std::sqrt(static_cast<float>(std::max(1U, wedges)));
}

/// Connected pieces of the surface: eyes, buttons, hair. A small one vanishes as a whole when the
/// surface around it is as coarse as it is large.
struct Piece {
  std::vector<std::uint32_t> triangles;
  float area_m2 = 0.0F;
  float distance_m = 0.0F;  // what opens where it was
  float other_cost = 0.0F;  // lost extents and colours
  std::uint32_t points = 0, wedges = 0;
  bool is_gone = false;

  /// In m^4 for each vertex that is won, like the cost of a collapse.
  float removal_cost() const {
    return (area_m2 * distance_m * distance_m + other_cost) * vertex_share(wedges);
  }
};

struct State {
  State(const PoseSet& pose_set, const CollapseOptions& collapse_options, WedgeMesh& wedge_mesh,
        float size_m, std::span<const float> visible)
      : options(collapse_options),
        mesh(wedge_mesh),
        poses(pose_set, wedge_mesh, size_m, visible),
        attributes(wedge_mesh, size_m) {}

  const CollapseOptions& options;
  WedgeMesh& mesh;
  PoseCost poses;
  AttributeCost attributes;
  std::vector<Piece> pieces;
  std::vector<std::uint32_t> piece_of;  // [P]
  std::vector<std::uint32_t> mirror;    // [P] or empty
  std::vector<bool> is_fixed;           // [P] Peng et al.'s fixed vertices
  std::size_t phase = 0;
  float last_cost = 0.0F;
  float error_m = 0.0F;  // never falls
};

/// Cost and record of collapses for OpenMesh's decimater.
class WedgeModule : public OpenMesh::Decimater::ModBaseT<HalfEdgeMesh> {
 public:
  using Base = OpenMesh::Decimater::ModBaseT<HalfEdgeMesh>;
  using Handle = OpenMesh::Decimater::ModHandleT<WedgeModule>;
  DECIMATER_MODNAME(WedgeModule);

  explicit WedgeModule(HalfEdgeMesh& mesh) : Base(mesh, false) {}

  void attach(State* state) { state_ = state; }

  float collapse_priority(const CollapseInfo& info) override {
    // The decimater asks for all half-edges of a point in one go and takes the cheapest, so one
    // that costs more than the best so far needs no further tests.
    if (asked_ != info.v0.idx()) {
      asked_ = info.v0.idx();
      best_ = std::numeric_limits<float>::max();
    }
    const float cost =
        state_->options.criterion == Criterion::kPeng2011 ? peng_cost(info) : throng_cost(info);
    if (cost >= 0.0F) best_ = std::min(best_, cost);
    return cost;
  }

  void preprocess_collapse(const CollapseInfo& info) override {
    const std::uint32_t a = index(info.v0), b = index(info.v1);
    look_around(info);
    const PoseCost::Cost cost = state_->poses.move_cost(a, b);
    const float area_m2 = state_->poses.area_m2(a);
    if (area_m2 > 0.0F)
      state_->error_m = std::max(state_->error_m, std::sqrt(cost.largest / area_m2));
    state_->last_cost = total(cost) * vertex_share(state_->mesh.alive_wedges(a));
    const std::uint32_t before = state_->mesh.alive_wedges();
    state_->mesh.collapse(a, b, around_, moves_, state_->error_m);
    state_->poses.merge(a, b);
    Piece& piece = state_->pieces[state_->piece_of[a]];
    --piece.points;
    piece.wedges -= before - state_->mesh.alive_wedges();
    asked_ = -1;
  }

  void postprocess_collapse(const CollapseInfo&) override { asked_ = -1; }

 private:
  template <typename AnyHandle>
  static std::uint32_t index(AnyHandle handle) {
    return handle.is_valid() ? static_cast<std::uint32_t>(handle.idx()) : kNoIndex;
  }

  static float total(const PoseCost::Cost& cost) {
    return (1.0F - kWorstPose) * cost.mean + kWorstPose * cost.largest;
  }

  void look_around(const CollapseInfo& info) {
    around_.clear();
    for (const auto face : mesh().vf_range(info.v0)) around_.push_back(index(face));
    state_->mesh.find_moves(index(info.v0), index(info.v1), around_, moves_);
  }

  const WedgeMove* move_of(std::uint32_t triangle, std::uint32_t a) const {
    const glm::uvec3& points = state_->mesh.points(triangle);
    const std::uint32_t wedge = state_->mesh.wedges(triangle)[points.x == a   ? 0
                                                              : points.y == a ? 1
                                                                              : 2];
    for (const WedgeMove& move : moves_) {
      if (move.from == wedge) return &move;
    }
    return nullptr;
  }

  /// Whether two triangles of a share another point, but not a's wedge.
  bool lies_beyond_seam(std::uint32_t dying, std::uint32_t triangle, std::uint32_t a) const {
    const auto& mesh = state_->mesh;
    std::uint32_t own = kNoIndex, other = kNoIndex;
    bool are_neighbours = false;
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t point = mesh.points(triangle)[i];
      if (point == a) own = mesh.wedges(triangle)[i];
      are_neighbours |= point != a && mesh.has(dying, point);
      if (mesh.points(dying)[i] == a) other = mesh.wedges(dying)[i];
    }
    return are_neighbours && own != other;
  }

  bool breaks_any(std::uint32_t a, std::uint32_t b, const Phase& phase) const {
    for (const std::uint32_t triangle : around_) {
      if (state_->mesh.has(triangle, b)) continue;
      const glm::uvec3& points = state_->mesh.points(triangle);
      const int corner = points.x == a ? 0 : points.y == a ? 1 : 2;
      if (state_->poses.breaks(a, b, points[(corner + 1) % 3], points[(corner + 2) % 3],
                               phase.least_cosine, phase.least_quality, phase.bind_pose_only)) {
        return true;
      }
    }
    return false;
  }

  /// Left and right share what their moves cost, so that a limb that swings more in the clips, or
  /// holds something, is not kept at the expense of the other; where the other side has moved
  /// already, that was free.
  float place_cost(std::uint32_t a, std::uint32_t b) const {
    const auto own_cost = [&](std::uint32_t from, std::uint32_t to) {
      return total(state_->poses.move_cost(from, to)) + state_->poses.extent_cost(from, to, false);
    };
    const float own = own_cost(a, b);
    if (state_->mirror.empty()) return own;
    const std::uint32_t c = state_->mirror[a], d = state_->mirror[b];
    if (c == kNoIndex || d == kNoIndex || c == a || c == d || d == b) return own;
    const bool is_alive = state_->mesh.alive_wedges(c) > 0;
    return 0.5F * (own + (is_alive ? own_cost(c, d) : 0.0F));
  }

  float throng_cost(const CollapseInfo& info) {
    const std::uint32_t a = index(info.v0), b = index(info.v1);
    const Phase& phase = kPhases[state_->phase];
    const float share = vertex_share(state_->mesh.alive_wedges(a));
    float cost =
        share * (place_cost(a, b) + state_->poses.area_m2(a) * state_->attributes.joint_cost(a, b));
    if (cost >= best_) return Base::ILLEGAL_COLLAPSE;
    look_around(info);
    for (const std::uint32_t triangle : around_) {
      if (state_->mesh.has(triangle, b)) continue;
      const WedgeMove* move = move_of(triangle, a);
      if (move == nullptr || move->to == kNoIndex) return Base::ILLEGAL_COLLAPSE;
      cost += share * state_->attributes.triangle_cost(triangle, a, b, *move);
      for (const std::uint32_t dying : around_) {
        if (!state_->mesh.has(dying, b) || !lies_beyond_seam(dying, triangle, a)) continue;
        cost += share * state_->attributes.covering_cost(dying, triangle, a, *move);
      }
      if (!phase.may_mirror && move->is_exact && state_->attributes.mirrors(triangle, a, *move)) {
        return Base::ILLEGAL_COLLAPSE;
      }
    }
    if (cost >= best_ || breaks_any(a, b, phase)) return Base::ILLEGAL_COLLAPSE;
    return cost;
  }

  /// Section 4.2 of the paper. A regular vertex may merge into any neighbour. A companioned one may
  /// if its companion has a wedge of the same point for neighbour; the paper's last step misprints
  /// the indices: companion(a) merges into the wedge c of b for which (companion(a), c) is an edge.
  float peng_cost(const CollapseInfo& info) {
    const std::uint32_t a = index(info.v0), b = index(info.v1);
    if (state_->is_fixed[a]) return Base::ILLEGAL_COLLAPSE;
    const float cost = state_->poses.move_cost(a, b).mean;
    if (cost >= best_) return Base::ILLEGAL_COLLAPSE;
    look_around(info);
    const bool is_companioned = state_->mesh.initial_wedges(a) == 2;
    for (const WedgeMove& move : moves_) {
      if (!move.is_exact || (is_companioned && move.is_ambiguous)) return Base::ILLEGAL_COLLAPSE;
    }
    // the paper relies on face normals against inversion; here in the bind pose
    return breaks_any(a, b, {0.0F, 0.0F, true, true}) ? static_cast<float>(Base::ILLEGAL_COLLAPSE)
                                                      : cost;
  }

  State* state_ = nullptr;
  int asked_ = -1;
  float best_ = 0.0F;
  std::vector<std::uint32_t> around_;
  std::vector<WedgeMove> moves_;
};

/// Index of the piece that should vanish first, kNoIndex where there is none.
std::uint32_t cheapest_piece(const State& state, std::uint32_t most_points) {
  std::uint32_t cheapest = kNoIndex;
  std::size_t alive = 0;
  for (std::uint32_t i = 0; i < state.pieces.size(); ++i) {
    const Piece& piece = state.pieces[i];
    if (piece.is_gone) continue;
    ++alive;
    if (piece.points > most_points) continue;
    if (cheapest == kNoIndex || piece.removal_cost() < state.pieces[cheapest].removal_cost())
      cheapest = i;
  }
  return alive > 1 ? cheapest : kNoIndex;
}

constexpr std::uint32_t kSmallPiece = 12;  // points at which a piece may vanish

/// Stops the decimater at `last_count` vertices or when a piece should vanish.
class Watcher : public OpenMesh::Decimater::Observer {
 public:
  Watcher(const State& state, std::uint32_t last_count)
      : Observer(1), state_(state), first_(state.mesh.alive_wedges()), last_count_(last_count) {}

  /// Another run begins. Each one computes all costs again, so a piece has to wait for a share of
  /// the surface to go.
  void begin_run() {
    run_steps_ = 0;
    least_steps_ = state_.mesh.alive_wedges() / 40;
  }

  void notify(std::size_t) override {
    ++run_steps_;
    if (state_.options.on_progress && state_.mesh.steps().size() % 256 == 0) {
      const auto left = static_cast<float>(state_.mesh.alive_wedges());
      state_.options.on_progress(kFineShare * (1.0F - left / static_cast<float>(first_)));
    }
  }

  bool abort() const override {
    if (state_.options.criterion == Criterion::kPeng2011) return false;
    if (state_.mesh.alive_wedges() <= last_count_) return true;
    if (run_steps_ <= least_steps_) return false;
    const std::uint32_t piece = cheapest_piece(state_, kSmallPiece);
    return piece != kNoIndex && state_.pieces[piece].removal_cost() < state_.last_cost;
  }

 private:
  const State& state_;
  std::uint32_t first_, last_count_;
  std::size_t run_steps_ = 0, least_steps_ = 0;
};

void find_pieces(const WedgeMesh& mesh, State& state) {
  const std::vector<SourcePoint>& points = mesh.surface().points;
  const auto triangles = static_cast<std::uint32_t>(mesh.surface().triangles.size());
  std::vector<std::uint32_t> parent(points.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto find = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (std::uint32_t t = 0; t < triangles; ++t) {
    for (int i = 1; i < 3; ++i) parent[find(mesh.points(t)[i])] = find(mesh.points(t)[0]);
  }
  std::vector<std::uint32_t> number(points.size(), kNoIndex);
  std::vector<glm::vec3> low, high;
  state.piece_of.resize(points.size());
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    std::uint32_t& piece = number[find(p)];
    if (piece == kNoIndex) {
      piece = static_cast<std::uint32_t>(state.pieces.size());
      state.pieces.emplace_back();
      low.push_back(points[p].position);
      high.push_back(points[p].position);
    }
    state.piece_of[p] = piece;
    ++state.pieces[piece].points;
    state.pieces[piece].wedges += mesh.initial_wedges(p);
    low[piece] = glm::min(low[piece], points[p].position);
    high[piece] = glm::max(high[piece], points[p].position);
  }
  for (std::uint32_t t = 0; t < triangles; ++t) {
    const std::uint32_t piece = state.piece_of[mesh.points(t)[0]];
    state.pieces[piece].triangles.push_back(t);
    state.pieces[piece].area_m2 += state.poses.initial_area_m2(t);
  }
  for (std::size_t i = 0; i < state.pieces.size() && state.pieces.size() > 1; ++i) {
    Piece& piece = state.pieces[i];
    // How far behind it the others are: an eye bares the head, a leg the background. At least a
    // part of its middle extent, for a strap is seen by its width and not by its length.
    double squares = 0.0, color = 0.0;
    std::size_t count = 0;
    const std::size_t own_step = std::max<std::size_t>(1, piece.triangles.size() / 24);
    const std::size_t other_step = std::max<std::size_t>(1, triangles / 3000);
    for (std::size_t k = 0; k < piece.triangles.size(); k += own_step, ++count) {
      const glm::vec3& from = points[mesh.points(piece.triangles[k])[0]].position;
      float least = std::numeric_limits<float>::max();
      std::uint32_t nearest = kNoIndex;
      for (std::uint32_t t = 0; t < triangles; t += static_cast<std::uint32_t>(other_step)) {
        const std::uint32_t other = mesh.points(t)[0];
        // a larger one only: what lies over a piece may go before it
        if (!(state.pieces[state.piece_of[other]].area_m2 > piece.area_m2)) continue;
        const glm::vec3 away = points[other].position - from;
        if (glm::dot(away, away) >= least) continue;
        least = glm::dot(away, away);
        nearest = t;
      }
      if (nearest != kNoIndex) color += state.attributes.baring_cost(piece.triangles[k], nearest);
      squares += least;
    }
    glm::vec3 extent = high[i] - low[i];
    std::sort(&extent.x, &extent.x + 3);
    const auto rms_m = static_cast<float>(
        std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, count))));
    // what the whole figure loses of its extents, as in PoseCost::extent_cost
    glm::vec3 others_low(std::numeric_limits<float>::max()), others_high(-others_low);
    for (std::size_t k = 0; k < state.pieces.size(); ++k) {
      if (!(state.pieces[k].area_m2 > piece.area_m2)) continue;
      others_low = glm::min(others_low, low[k]);
      others_high = glm::max(others_high, high[k]);
    }
    const glm::vec3 lost =
        glm::max(glm::vec3(0.0F), glm::max(others_low - low[i], high[i] - others_high));
    piece.other_cost =
        state.poses.extent_weight() * glm::dot(lost, lost) +
        piece.area_m2 *
            static_cast<float>(color / static_cast<double>(std::max<std::size_t>(1, count)));
    // never farther than it is long, where the others were hit by no sample
    piece.distance_m = std::max(0.25F * extent.y, std::min(rms_m, extent.z));
  }
}

/// A wedge of another piece near the one that goes. What collapses there is never drawn.
std::uint32_t nearest_other_wedge(const State& state, std::uint32_t piece) {
  const Surface& surface = state.mesh.surface();
  const glm::vec3 from =
      surface.points[state.mesh.points(state.pieces[piece].triangles[0])[0]].position;
  std::uint32_t nearest = kNoIndex;
  float least = std::numeric_limits<float>::max();
  for (std::uint32_t i = 0; i < state.pieces.size(); ++i) {
    if (i == piece || state.pieces[i].is_gone) continue;
    for (const std::uint32_t triangle : state.pieces[i].triangles) {
      if (!state.mesh.is_alive(triangle)) continue;
      const glm::vec3 away = surface.points[state.mesh.points(triangle)[0]].position - from;
      if (glm::dot(away, away) >= least) continue;
      least = glm::dot(away, away);
      nearest = state.mesh.wedges(triangle)[0];
    }
  }
  return nearest;
}

void remove_piece(std::uint32_t index, State& state, HalfEdgeMesh& half_edges) {
  Piece& piece = state.pieces[index];
  std::vector<std::uint32_t> alive;
  for (const std::uint32_t triangle : piece.triangles) {
    if (state.mesh.is_alive(triangle)) alive.push_back(triangle);
  }
  state.error_m = std::max(state.error_m, piece.distance_m);
  state.mesh.remove(alive, nearest_other_wedge(state, index), state.error_m);
  for (const std::uint32_t triangle : alive) {
    half_edges.delete_face(HalfEdgeMesh::FaceHandle(static_cast<int>(triangle)), true);
  }
  piece.is_gone = true;
}

absl::Status build(const WedgeMesh& mesh, HalfEdgeMesh& half_edges) {
  for (const SourcePoint& point : mesh.surface().points) {
    half_edges.add_vertex({point.position.x, point.position.y, point.position.z});
  }
  for (std::uint32_t t = 0; t < mesh.surface().triangles.size(); ++t) {
    const glm::uvec3& points = mesh.points(t);
    const auto handle = [](std::uint32_t i) {
      return HalfEdgeMesh::VertexHandle(static_cast<int>(i));
    };
    if (!half_edges.add_face(handle(points.x), handle(points.y), handle(points.z)).is_valid()) {
      return absl::InvalidArgumentError(absl::StrCat("collapse: triangle ", t, " (points ",
                                                     points.x, ", ", points.y, ", ", points.z,
                                                     ") makes the surface no manifold"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status decimate(const PoseSet& poses, const CollapseOptions& options,
                      const std::function<bool()>& prefers_tones, WedgeMesh& mesh,
                      std::uint32_t& toned_count, std::vector<std::string>& notes) {
  HalfEdgeMesh half_edges;
  if (auto status = build(mesh, half_edges); !status.ok()) return status;

  glm::vec3 low(std::numeric_limits<float>::max()), high(-low);
  for (const SourcePoint& point : mesh.surface().points) {
    low = glm::min(low, point.position);
    high = glm::max(high, point.position);
  }
  const glm::vec3 extent = high - low;
  const float size_m = std::max(extent.x, std::max(extent.y, extent.z));
  const bool is_peng = options.criterion == Criterion::kPeng2011;
  std::optional<Views> views;
  if (!is_peng) views.emplace(poses, mesh, size_m);
  State state(poses, options, mesh, size_m,
              is_peng ? std::vector<float>() : views->visibility(mesh));
  find_pieces(mesh, state);
  if (!is_peng) state.mirror = find_mirror(mesh.surface(), size_m);
  if (is_peng) {
    state.is_fixed.resize(mesh.surface().points.size());
    for (std::uint32_t p = 0; p < state.is_fixed.size(); ++p) {
      state.is_fixed[p] = mesh.initial_wedges(p) > 2 ||
                          half_edges.is_boundary(HalfEdgeMesh::VertexHandle(static_cast<int>(p)));
    }
  }

  OpenMesh::Decimater::DecimaterT<HalfEdgeMesh> decimater(half_edges);
  OpenMesh::Decimater::ModHandleT<WedgeModule> handle;
  decimater.add(handle);
  decimater.module(handle).attach(&state);
  if (!decimater.initialize())
    return absl::InternalError("collapse: OpenMesh's decimater has no cost module");
  const std::uint32_t last_count = std::max(
      options.coarsest_count,
      std::min(kContractCount, static_cast<std::uint32_t>(
                                   kContractShare * static_cast<float>(mesh.alive_wedges()))));
  Watcher watcher(state, last_count);
  decimater.set_observer(&watcher);

  for (;;) {
    watcher.begin_run();
    const std::size_t before = mesh.steps().size();
    decimater.decimate();
    if (is_peng || mesh.alive_wedges() <= last_count) break;
    const bool is_stuck = mesh.steps().size() == before;
    // pieces that cost no more than the last collapse; all of them, because a run is not for free
    bool is_removed = false;
    for (std::uint32_t piece; (piece = cheapest_piece(state, kSmallPiece)) != kNoIndex;) {
      if (state.pieces[piece].removal_cost() >= state.last_cost) break;
      remove_piece(piece, state, half_edges);
      is_removed = true;
      if (mesh.alive_wedges() <= last_count) break;
    }
    if (is_removed || !is_stuck) continue;
    if (++state.phase == kPhaseCount) break;
  }
  if (!is_peng && mesh.alive_wedges() > options.coarsest_count) {
    toned_count =
        contract(options.coarsest_count, size_m, options.threads, prefers_tones, state.poses,
                 state.attributes, state.mirror, *views, state.error_m, mesh, [&](float share) {
                   if (options.on_progress)
                     options.on_progress(kFineShare + (1.0F - kFineShare) * share);
                 });
  }
  if (!is_peng && mesh.alive_wedges() > options.coarsest_count) {
    notes.push_back(absl::StrCat("coarsest level has ", mesh.alive_wedges(), " vertices, wanted ",
                                 options.coarsest_count));
  }
  if (options.on_progress) options.on_progress(1.0F);
  return absl::OkStatus();
}

}  // namespace throng::simplify
