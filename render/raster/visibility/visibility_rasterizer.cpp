#include "render/raster/visibility/visibility_rasterizer.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>
#include <utility>
#include <vector>

#include "render/compute/cpu/levels.hpp"
#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/hash.hpp"
#include "render/raster/element/figure_shadow.hpp"
#include "render/raster/element/tone.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/bins.hpp"
#include "render/raster/visibility/cpu/relief.hpp"
#include "render/raster/visibility/cpu/shade.hpp"
#include "render/raster/visibility/cpu/speck.hpp"
#include "render/raster/visibility/cpu/splat.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/element/shadow.hpp"
#include "render/raster/visibility/element/word.hpp"

namespace throng::render::visibility {
namespace {

constexpr std::uint32_t kMaxSidePx = 16384;
constexpr std::size_t kPixels = kTilePx * kTilePx;
constexpr std::uint64_t kCellRefreshTriangles = 512;
/// Instances seen in at least so many tiles have their triangles culled once for all of them.
constexpr std::uint32_t kListTiles = 2;

/// What a tile needs to know of a visible instance; they lie anywhere in memory, so one cache line.
struct alignas(64) DrawnInstance {
  static constexpr std::uint32_t kShared = 1U << 31, kDoubleSided = 1U << 30, kClipped = 1U << 29,
                                 kFlat = 1U << 28, kListed = 1U << 27, kRelief = 1U << 26,
                                 kToned = 1U << 25;
  static constexpr std::uint32_t kCharacter = 0xffff;

  std::uint16_t x_low, y_low, x_high, y_high;  // samples, inclusive; x_low > x_high: nothing
  float depth_high;
  std::uint32_t flags;  // and the character
  std::uint32_t first_block;
  std::uint32_t triangle_count;
  // corner of FrameGeometry::indices, shared: triangle of LevelTable, relief: of placed_
  std::uint32_t first;
  struct Shared {
    std::uint32_t posed;  // x column of the posed mesh
    std::uint16_t stride, vertex_count;
    glm::vec3 feet_relative;
    float cosine_scale, sine_scale, scale;
  };
  struct Listed {
    std::uint32_t list;
    TriangleList::Range small, large;
  };
  union {
    Shared shared;  // kShared
    Listed listed;  // kListed
  };
};
static_assert(sizeof(DrawnInstance) == 64);

/// Everything one worker needs for one tile: mostly stays in the second-level cache.
struct TileScratch {
  TilePlanes planes;
  TilePlanes shadow;  // depth: share of light that a cast shadow takes
  FigureItems figures;
  ShadeItems flat_items;
  SurfaceItems surface_items, splat_items;
  alignas(64) std::uint32_t relief_texels[kTileSamples * kTileSamples];
  SharedScratch shared;
  std::vector<std::uint64_t> order;
  SpeckScratch speck;
  alignas(64) float missing[kPixels];
  alignas(64) float rgb[3][kPixels];
  alignas(64) float row[3][kTilePx];
  alignas(64) float background_share[kPixels];
  SpeckTile specks;
  TileCounters counters;
};

class VisibilityRasterizer final : public Rasterizer {
 public:
  VisibilityRasterizer(unsigned threads, std::string why, bool occlusion)
      : pool_(threads), why_(std::move(why)), occlusion_(occlusion) {
    scratch_.resize(pool_.thread_count());
    for (auto& one : scratch_) one = std::make_unique<TileScratch>();
  }

  RasterInfo info() const override {
    return {absl::StrCat("visibility (cpu, ", pool_.thread_count(), " threads)"),
            absl::StrCat("CPU visibility rasterizer, ", simd_name(), ", 4 samples a pixel",
                         why_.empty() ? "" : "; ", why_)};
  }

  bool takes_fused() const override { return true; }
  bool draws(Representation form) const override { return form <= Representation::kSpeck; }
  RasterCounters counters() const override;
  absl::Status keep_facts(PixelFacts* facts) override {
    facts_ = facts;
    return absl::OkStatus();
  }
  absl::Status upload(std::shared_ptr<const Cast> cast) override;
  absl::Status draw(const FrameGeometry& geometry, const Camera& camera, const Viewport& viewport,
                    const glm::dvec3& origin_world, const Look& look, Picture& picture) override;

 private:
  absl::Status check(const FrameGeometry& geometry, const Viewport& viewport) const;
  absl::Status check_tones(const FrameGeometry& geometry, std::size_t i) const;
  void prepare(const FrameGeometry& geometry);
  Footprint list_instance(const FrameGeometry& geometry, std::size_t i, const Footprint& vertices,
                          unsigned worker);
  void project_shadows(const FrameGeometry& geometry, const SceneFrame& scene);
  absl::Status number_blocks(const FrameGeometry& geometry);
  void bin();
  struct Caster;
  void cut_wall_shadow(const SceneFrame& scene, const InstanceShade& shade, Caster& caster,
                       std::uint32_t& vertices, std::uint32_t& indices);
  void bin_shadows(const FrameGeometry& geometry, const SceneFrame& scene,
                   const Viewport& viewport);
  void collect_facts(int tile_x_px, int tile_y_px, int width, int height, int picture_width,
                     std::span<const Splat> splats, const TilePlanes& planes) const;
  void blend_specks(const FrameGeometry& geometry, std::size_t tile, int tile_x_px, int tile_y_px,
                    bool has_planes, TileScratch& scratch) const;
  void prefetch(const FrameGeometry& geometry, const DrawnInstance& drawn) const;
  InstanceTriangles own_triangles(const FrameGeometry& geometry, const DrawnInstance& drawn,
                                  bool clipped) const;
  std::uint32_t tone_shift(const FrameGeometry& geometry, std::size_t i) const;
  /// Null: no holes.
  const Cutout* cutout_of(const DrawnInstance& drawn) const;
  SharedTriangles shared_triangles(const FrameGeometry& geometry, const DrawnInstance& drawn) const;
  void draw_tile(const FrameGeometry& geometry, const SceneFrame& scene, const Viewport& viewport,
                 std::size_t tile, TileScratch& scratch, Picture& picture) const;
  bool is_relief(const FrameGeometry& geometry, std::size_t instance) const {
    return !geometry.representation.empty() &&
           geometry.representation[instance] == Representation::kImpostor;
  }
  void add_relief(const FrameGeometry& geometry, std::uint32_t instance, std::uint32_t box,
                  int sample_x, int sample_y, std::size_t sample, TileScratch& scratch) const;
  void find_figures(const FrameGeometry& geometry, const SceneFrame& scene);
  void collect_items(const FrameGeometry& geometry, const SceneFrame& scene, int tile_x_px,
                     int tile_y_px, int width, int height, TileScratch& scratch) const;
  void collect_missing(const SceneFrame& scene, std::size_t tile, int tile_x_px, int tile_y_px,
                       int width, int height, TileScratch& scratch) const;
  void add_background(const SceneFrame& scene, std::size_t tile, int tile_x_px, int tile_y_px,
                      int width, int height, TileScratch& scratch,
                      const FrameGeometry& geometry) const;

  WorkPool pool_;
  std::string why_;
  bool occlusion_;
  std::vector<std::unique_ptr<TileScratch>> scratch_;
  std::shared_ptr<const Cast> cast_;
  TextureStore textures_;
  SplatStage splats_;
  SpeckStage specks_;
  SpeckScene speck_scene_{};
  // of who is drawn by splats: specks of which nothing but the shadow is drawn
  SpeckStage splat_shadows_;
  SpeckTable shadow_table_;
  std::vector<SpeckRun> shadow_runs_;
  FrameGeometry shadows_of(const FrameGeometry& geometry) const;
  void place_shadows(const FrameGeometry& geometry);
  std::vector<std::uint8_t> double_sided_;  // by character
  std::vector<Cutout> cutouts_;             // by character; no flags: no triangle has holes

  // of the frame; grow only
  SampleGrid grid_{};
  std::size_t count_ = 0;  // V
  std::uint32_t tiles_x_ = 0, tiles_y_ = 0;
  Projected projected_;
  std::vector<TriangleList> lists_;  // one a worker
  LevelTable levels_;
  std::vector<TriangleTone> tones_;          // by triangle of the levels
  std::vector<std::uint32_t> uv_;            // of all characters' vertices
  std::vector<std::uint32_t> first_uv_;      // by character
  std::vector<std::uint32_t> corner_tones_;  // of all characters' bands
  std::vector<std::uint32_t> first_tone_;    // by character
  std::vector<std::uint32_t> tone_shift_;    // [V] SharedMeshes::tone_shift
  std::vector<DrawnInstance> drawn_;         // [V]
  std::vector<SharedShade> shared_shades_;   // [V] of fused geometry
  ReliefStore reliefs_;                      // of the cast
  ReliefView relief_view_{};
  ReliefSearch relief_search_;
  std::vector<PlacedBox> placed_;              // boxes of visible impostors
  std::vector<std::uint32_t> block_instance_;  // [blocks]
  std::vector<InstanceShade> shades_;          // [V]
  Bins<std::uint64_t> bins_;                   // depth and number: rising is near to far
  Bins<std::uint32_t> blob_bins_, caster_bins_;
  struct BlobRecord {
    Blob blob;
    element::SampleBox place;
  };
  std::vector<BlobRecord> blobs_;  // [V]
  std::vector<std::uint32_t> casters_;
  // who may throw a shadow on the surroundings; of no use where none are seen
  bool shades_surroundings_ = false;
  std::vector<std::uint32_t> figure_first_, figure_next_;
  element::FigureCells figures_;
  element::Sunward sunward_{};
  std::vector<BatchVertex> shadow_vertices_;
  std::vector<std::uint32_t> shadow_indices_;
  Projected shadow_projected_;
  struct Caster {
    Footprint footprint;
    static constexpr std::uint32_t kAllTriangles = 0xffffffffU;
    std::uint32_t first_vertex, vertices, first_index, triangles;
    std::uint32_t level;  // or kAllTriangles: as the figure
  };
  std::vector<Caster> caster_shapes_;
  PixelFacts* facts_ = nullptr;  // null: nobody asks
};

RasterCounters VisibilityRasterizer::counters() const {
  RasterCounters sum;
  for (const auto& one : scratch_) {
    sum.drawn += one->counters.instances;
    sum.hidden += one->counters.hidden;
    sum.triangles += one->counters.triangles;
    sum.surviving += one->counters.surviving;
    sum.shaded += one->counters.shaded;
    sum.size_bytes += sizeof(TileScratch) + 8 * one->order.capacity() + one->speck.size_bytes();
  }
  const auto add = [&sum](const auto& values) {
    sum.size_bytes += values.capacity() * sizeof(values[0]);
  };
  add(textures_.texels);
  add(levels_.corners);
  add(reliefs_.shape);
  add(reliefs_.base);
  add(reliefs_.regions);
  add(placed_);
  add(tones_);
  add(uv_);
  add(drawn_);
  add(shared_shades_);
  add(block_instance_);
  add(shades_);
  for (const Projected* projected : {&projected_, &shadow_projected_}) {
    add(projected->x);
    add(projected->y);
    add(projected->depth);
    add(projected->inverse_w);
  }
  for (const TriangleList& list : lists_) sum.size_bytes += list.size_bytes();
  sum.size_bytes += splats_.size_bytes() + specks_.size_bytes() + splat_shadows_.size_bytes() +
                    bins_.size_bytes() + blob_bins_.size_bytes() + caster_bins_.size_bytes();
  add(blobs_);
  add(figure_first_);
  add(figure_next_);
  add(shadow_vertices_);
  add(shadow_indices_);
  return sum;
}

absl::Status VisibilityRasterizer::upload(std::shared_ptr<const Cast> cast) {
  if (cast == nullptr || cast->members.empty()) {
    return absl::InvalidArgumentError("visibility upload: the cast is empty");
  }
  // Of a cast that is here already only the surroundings are new.
  const std::size_t kept = cast_ != nullptr ? kept_members(*cast, *cast_) : 0;
  cast_ = nullptr;
  absl::StatusOr<TextureStore> store = make_textures(*cast, std::move(textures_), kept);
  if (!store.ok()) return store.status();
  std::vector<std::uint8_t> double_sided;
  for (const CastMember& member : cast->members) {
    std::uint8_t flags = 0;
    for (const std::uint8_t one : member.character.triangle_flags) flags |= one;
    double_sided.push_back((flags & kTriangleDoubleSided) != 0);
  }
  try {
    auto reliefs = make_relief_store(*cast, std::move(reliefs_), kept);
    if (!reliefs.ok()) return reliefs.status();
    reliefs_ = *std::move(reliefs);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("visibility upload: no memory for the cast's impostors");
  }
  textures_ = *std::move(store);
  cutouts_.clear();
  for (std::size_t i = 0; i < cast->members.size(); ++i) {
    const std::span<const std::uint8_t> flags = cast->members[i].character.triangle_flags;
    const bool holes = std::any_of(flags.begin(), flags.end(), [](std::uint8_t one) {
      return (one & kTriangleAlphaCutout) != 0;
    });
    const TextureInfo& info = textures_.infos[i];
    cutouts_.push_back({holes ? flags.data() : nullptr, textures_.texels.data() + info.base_first,
                        info.base_width, info.base_height, info.base_levels});
  }
  double_sided_ = std::move(double_sided);
  if (kept > 0) {
    set_surroundings(*cast, levels_);
  } else {
    levels_ = make_levels(*cast);
    tones_ = make_tones(*cast, levels_, textures_);
  }
  const auto cut = [kept](std::vector<std::uint32_t>& first, std::vector<std::uint32_t>& values) {
    if (kept < first.size()) values.resize(first[kept]);
    first.resize(std::min(kept, first.size()));
  };
  const std::span new_members = std::span(cast->members).subspan(kept);
  cut(first_uv_, uv_);
  for (const CastMember& member : new_members) {
    first_uv_.push_back(static_cast<std::uint32_t>(uv_.size()));
    for (const glm::u16vec2& uv : member.character.uv) {
      uv_.push_back(std::uint32_t{uv.x} | std::uint32_t{uv.y} << 16);
    }
  }
  cut(first_tone_, corner_tones_);
  for (const CastMember& member : new_members) {
    first_tone_.push_back(static_cast<std::uint32_t>(corner_tones_.size()));
    const std::span<const std::uint32_t> tone = member.character.corner_tones.tone;
    corner_tones_.insert(corner_tones_.end(), tone.begin(), tone.end());
  }
  cast_ = std::move(cast);
  return absl::OkStatus();
}

absl::Status VisibilityRasterizer::check(const FrameGeometry& geometry,
                                         const Viewport& viewport) const {
  if (viewport.width_px < 1 || viewport.width_px > kMaxSidePx || viewport.height_px < 1 ||
      viewport.height_px > kMaxSidePx) {
    return absl::InvalidArgumentError(absl::StrCat("visibility draw: viewport is ",
                                                   viewport.width_px, "x", viewport.height_px,
                                                   " px, each side must be 1 to ", kMaxSidePx));
  }
  if (geometry.splats.size() > kMostSplats) {
    return absl::ResourceExhaustedError(absl::StrCat("visibility draw: ", geometry.splats.size(),
                                                     " splats, at most ", kMostSplats));
  }
  for (const SpeckRun& run : geometry.speck_runs) {
    if (geometry.speck_table == nullptr ||
        std::uint64_t{run.first} + run.count > geometry.specks.size()) {
      return absl::InvalidArgumentError(absl::StrCat("visibility draw: specks ", run.first, " + ",
                                                     run.count, ", must end by ",
                                                     geometry.specks.size(), " and have a table"));
    }
  }
  for (const Speck& shadow : geometry.shadows) {
    if (shadow.image != 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("visibility draw: a shadow has image ", shadow.image, ", must be 0"));
    }
  }
  const std::size_t count = geometry.instances.size();
  if (count == 0) return absl::OkStatus();
  if (cast_ == nullptr) {
    return absl::FailedPreconditionError("visibility draw: no cast is uploaded");
  }
  if (geometry.vertex_offset.size() != count + 1 || geometry.triangle_offset.size() != count + 1 ||
      geometry.vertex_offset.back() != geometry.vertices.size() ||
      std::size_t{3} * geometry.triangle_offset.back() != geometry.indices.size()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "visibility draw: ", count, " instances need offsets of ", count + 1, " that end at ",
        geometry.vertices.size(), " vertices and ", geometry.indices.size() / 3, " triangles"));
  }
  if (geometry.vertices.size() > 0x7fffffffULL / 6 || geometry.indices.size() > 0x7fffffffULL) {
    return absl::ResourceExhaustedError(absl::StrCat("visibility draw: ", geometry.vertices.size(),
                                                     " vertices, at most ", 0x7fffffffULL / 6));
  }
  if (!geometry.shared.empty()) {
    if (geometry.shared.size() != count) {
      return absl::InvalidArgumentError(absl::StrCat("visibility draw: ", geometry.shared.size(),
                                                     " shared instances, must be ", count));
    }
    for (std::size_t i = 0; i < count; ++i) {
      const SharedInstance& shared = geometry.shared[i];
      if (shared.level == SharedInstance::kOwn) continue;
      if (shared.level >= levels_.levels.size() || geometry.posed == nullptr ||
          levels_.levels[shared.level].character != geometry.instances[i].character ||
          levels_.levels[shared.level].vertex_count > shared.stride || shared.stride > 0xffff) {
        return absl::InvalidArgumentError(
            absl::StrCat("visibility draw: instance ", i, " has level ", shared.level, " of ",
                         levels_.levels.size(), " and ", shared.stride, " posed vertices"));
      }
    }
  }
  if (!geometry.representation.empty() &&
      (geometry.representation.size() != count || geometry.jointed.size() != count)) {
    return absl::InvalidArgumentError(
        absl::StrCat("visibility draw: ", geometry.representation.size(), " representations and ",
                     geometry.jointed.size(), " jointed instances, must be ", count));
  }
  for (const VisibleInstance& instance : geometry.instances) {
    if (instance.character >= cast_->members.size()) {
      return absl::InvalidArgumentError(absl::StrCat("visibility draw: character is ",
                                                     instance.character, ", the cast has ",
                                                     cast_->members.size()));
    }
    const auto i = static_cast<std::size_t>(&instance - geometry.instances.data());
    if (absl::Status status = check_tones(geometry, i); !status.ok()) return status;
    const std::size_t joints = cast_->members[instance.character].character.joint_count();
    if (is_relief(geometry, i) &&
        std::size_t{16} * (geometry.jointed[i].first_joint + joints) > geometry.joints.size()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "visibility draw: instance ", i, " has joints ", geometry.jointed[i].first_joint, " + ",
          joints, ", must end by ", geometry.joints.size() / 16));
    }
  }
  return absl::OkStatus();
}

absl::Status VisibilityRasterizer::check_tones(const FrameGeometry& geometry, std::size_t i) const {
  const VisibleInstance& instance = geometry.instances[i];
  const CornerTones& tones = cast_->members[instance.character].character.corner_tones;
  if (instance.vertex_count > tones.most_vertices() || tones.band.empty()) {
    return absl::OkStatus();
  }
  std::uint32_t triangles = geometry.triangle_offset[i + 1] - geometry.triangle_offset[i];
  if (!geometry.shared.empty() && geometry.shared[i].level != SharedInstance::kOwn) {
    triangles = levels_.levels[geometry.shared[i].level].triangle_count;
  }
  const std::uint64_t end =
      element::first_tone(tones.band.data(), static_cast<std::uint32_t>(tones.band.size()),
                          instance.vertex_count) +
      std::uint64_t{3} * triangles;
  if (end <= tones.tone.size()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("visibility draw: instance ", i, " has ", triangles, " triangles with ",
                   instance.vertex_count, " vertices, its tones end at ", tones.tone.size() / 3));
}

void VisibilityRasterizer::prepare(const FrameGeometry& geometry) {
  const std::size_t count = geometry.instances.size();
  projected_.resize(geometry.vertices.size());
  if (!geometry.shared.empty()) shared_shades_.resize(count);
  tone_shift_.resize(count);
  lists_.resize(pool_.thread_count());
  for (TriangleList& list : lists_) {
    list.used = 0;
    list.large.clear();
  }
  constexpr std::size_t kChunk = 32;
  pool_.run((count + kChunk - 1) / kChunk, [&](std::size_t chunk, unsigned worker) {
    const std::size_t end = std::min(count, (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      const VisibleInstance& instance = geometry.instances[i];
      DrawnInstance& drawn = drawn_[i];
      drawn.flags = instance.character;
      if (double_sided_[instance.character] != 0) drawn.flags |= DrawnInstance::kDoubleSided;
      if ((shades_[i].character & kToned) != 0) {
        drawn.flags |= DrawnInstance::kToned;
        tone_shift_[i] = tone_shift(geometry, i);
      }
      Footprint f;
      if (is_relief(geometry, i)) {
        drawn.flags |= DrawnInstance::kRelief;
        f = place_boxes(reliefs_, reliefs_.members[instance.character], instance,
                        geometry.jointed[i], geometry.joints.data(), relief_view_, grid_,
                        placed_.data() + drawn.first);
      } else if (geometry.shared.empty() || geometry.shared[i].level == SharedInstance::kOwn) {
        drawn.first = 3 * geometry.triangle_offset[i];
        f = project_vertices(grid_, geometry.vertices.data(), geometry.vertex_offset[i],
                             geometry.vertex_offset[i + 1], projected_);
        const auto tiles = [](std::int32_t low, std::int32_t high) {
          return low > high
                     ? 0U
                     : static_cast<std::uint32_t>(high / kTileSamples - low / kTileSamples) + 1U;
        };
        if (cutout_of(drawn) == nullptr &&
            (f.clipped || tiles(f.x_low, f.x_high) * tiles(f.y_low, f.y_high) >= kListTiles)) {
          f = list_instance(geometry, i, f, worker);
        }
        if (f.clipped) drawn.flags |= DrawnInstance::kClipped;
      } else {
        const SharedInstance& shared = geometry.shared[i];
        const Level& level = levels_.levels[shared.level];
        const float* box = geometry.posed + shared.posed;
        drawn.flags |= DrawnInstance::kShared;
        drawn.first = level.first_triangle;
        drawn.shared.posed = shared.posed + kPosedHeader;
        drawn.shared.stride = static_cast<std::uint16_t>(shared.stride);
        drawn.shared.vertex_count = static_cast<std::uint16_t>(level.vertex_count);
        drawn.shared.feet_relative = instance.position_relative;
        drawn.shared.cosine_scale = shared.cosine_scale;
        drawn.shared.sine_scale = shared.sine_scale;
        drawn.shared.scale = instance.scale;
        f = project_box(grid_, {box[0], box[1], box[2]}, {box[3], box[4], box[5]},
                        shared_triangles(geometry, drawn));
        const bool double_sided = (drawn.flags & DrawnInstance::kDoubleSided) != 0;
        shared_shades_[i] = {drawn.shared.posed,
                             shared.stride,
                             first_uv_[instance.character],
                             0,
                             drawn.shared.cosine_scale,
                             drawn.shared.sine_scale,
                             drawn.shared.scale,
                             double_sided ? 1.0F : 0.0F};
        if (element::is_flat(shades_[i].size_px, level.triangle_count, instance.seed)) {
          drawn.flags |= DrawnInstance::kFlat;
        }
      }
      if (f.x_low > f.x_high || f.y_low > f.y_high) {
        f.x_low = 1;
        f.x_high = f.y_low = f.y_high = 0;
      }
      drawn.x_low = static_cast<std::uint16_t>(f.x_low);
      drawn.y_low = static_cast<std::uint16_t>(f.y_low);
      drawn.x_high = static_cast<std::uint16_t>(f.x_high);
      drawn.y_high = static_cast<std::uint16_t>(f.y_high);
      drawn.depth_high = f.depth_high;
    }
  });
}

std::uint32_t VisibilityRasterizer::tone_shift(const FrameGeometry& geometry, std::size_t i) const {
  const VisibleInstance& instance = geometry.instances[i];
  const std::span<const ToneBand> bands =
      cast_->members[instance.character].character.corner_tones.band;
  const std::uint32_t first =
      first_tone_[instance.character] +
      element::first_tone(bands.data(), static_cast<std::uint32_t>(bands.size()),
                          instance.vertex_count);
  const bool is_shared =
      !geometry.shared.empty() && geometry.shared[i].level != SharedInstance::kOwn;
  return first - 3 * (is_shared ? levels_.levels[geometry.shared[i].level].first_triangle
                                : geometry.triangle_offset[i]);
}

Footprint VisibilityRasterizer::list_instance(const FrameGeometry& geometry, std::size_t i,
                                              const Footprint& vertices, unsigned worker) {
  DrawnInstance& drawn = drawn_[i];
  TriangleList& list = lists_[worker];
  const auto first = static_cast<std::uint32_t>(list.used);
  const auto first_large = static_cast<std::uint32_t>(list.large.size());
  const InstanceTriangles triangles = own_triangles(geometry, drawn, vertices.clipped);
  const Footprint footprint =
      list_triangles(triangles, projected_, geometry.vertices.data(), grid_, list);
  scratch_[worker]->counters.triangles += drawn.triangle_count;
  drawn.flags |= DrawnInstance::kListed;
  drawn.listed = {worker,
                  {first, static_cast<std::uint32_t>(list.used) - first},
                  {first_large, static_cast<std::uint32_t>(list.large.size()) - first_large}};
  return footprint;
}

InstanceTriangles VisibilityRasterizer::own_triangles(const FrameGeometry& geometry,
                                                      const DrawnInstance& drawn,
                                                      bool clipped) const {
  return {geometry.indices.data() + drawn.first,
          drawn.triangle_count,
          drawn.first_block,
          (drawn.flags & DrawnInstance::kDoubleSided) != 0,
          clipped,
          cutout_of(drawn)};
}

const Cutout* VisibilityRasterizer::cutout_of(const DrawnInstance& drawn) const {
  if ((drawn.flags & DrawnInstance::kToned) != 0) return nullptr;  // no texture, no holes
  const Cutout& cutout = cutouts_[drawn.flags & DrawnInstance::kCharacter];
  return cutout.flags != nullptr ? &cutout : nullptr;
}

SharedTriangles VisibilityRasterizer::shared_triangles(const FrameGeometry& geometry,
                                                       const DrawnInstance& drawn) const {
  return {geometry.posed + drawn.shared.posed,
          drawn.shared.stride,
          drawn.shared.vertex_count,
          levels_.corners.data() + drawn.first,
          drawn.triangle_count,
          drawn.first_block,
          drawn.shared.feet_relative,
          drawn.shared.cosine_scale,
          drawn.shared.sine_scale,
          drawn.shared.scale,
          (drawn.flags & DrawnInstance::kDoubleSided) != 0};
}

absl::Status VisibilityRasterizer::number_blocks(const FrameGeometry& geometry) {
  const std::size_t count = geometry.instances.size();
  if (drawn_.size() < count) drawn_.resize(count + count / 2);
  std::uint64_t blocks = 0;
  std::size_t boxes = 0;
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t triangles = geometry.triangle_offset[i + 1] - geometry.triangle_offset[i];
    if (is_relief(geometry, i)) {
      triangles = reliefs_.members[geometry.instances[i].character].box_count;
      drawn_[i].first = static_cast<std::uint32_t>(boxes);
      boxes += triangles;
    } else if (!geometry.shared.empty() && geometry.shared[i].level != SharedInstance::kOwn) {
      triangles = levels_.levels[geometry.shared[i].level].triangle_count;
    }
    drawn_[i].first_block = static_cast<std::uint32_t>(blocks);
    drawn_[i].triangle_count = triangles;
    blocks += (triangles + element::kBlockTriangles - 1) / element::kBlockTriangles;
  }
  if (blocks > element::kMaxBlocks) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "visibility draw: ", blocks, " triangle blocks, at most ", element::kMaxBlocks));
  }
  if (boxes > 0xffffffffULL) {
    return absl::ResourceExhaustedError(
        absl::StrCat("visibility draw: ", boxes, " boxes of impostors, at most ", 0xffffffffU));
  }
  if (placed_.size() < boxes) placed_.resize(boxes + boxes / 2);
  if (block_instance_.size() < blocks) block_instance_.resize(blocks + blocks / 2);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t end =
        i + 1 < count ? drawn_[i + 1].first_block : static_cast<std::uint32_t>(blocks);
    std::fill(block_instance_.begin() + drawn_[i].first_block, block_instance_.begin() + end,
              static_cast<std::uint32_t>(i));
  }
  return absl::OkStatus();
}

void VisibilityRasterizer::bin() {
  const std::size_t tiles = std::size_t{tiles_x_} * tiles_y_;
  bins_.fill(tiles, count_, pool_, [&](std::size_t begin, std::size_t end, auto&& place) {
    for (std::size_t i = begin; i < end; ++i) {
      const DrawnInstance& drawn = drawn_[i];
      if (drawn.x_low > drawn.x_high) continue;
      // positive floats are in the order of their bits
      std::uint32_t depth = 0;
      std::memcpy(&depth, &drawn.depth_high, sizeof depth);
      const std::uint64_t entry = std::uint64_t{~depth} << 32 | i;
      for (std::uint32_t ty = drawn.y_low / kTileSamples; ty <= drawn.y_high / kTileSamples; ++ty) {
        for (std::uint32_t tx = drawn.x_low / kTileSamples; tx <= drawn.x_high / kTileSamples;
             ++tx) {
          place(std::size_t{ty} * tiles_x_ + tx, entry);
        }
      }
    }
  });
}

void VisibilityRasterizer::project_shadows(const FrameGeometry& geometry, const SceneFrame& scene) {
  caster_shapes_.resize(casters_.size());
  std::uint32_t vertices = 0, indices = 0;
  for (std::size_t c = 0; c < casters_.size(); ++c) {
    const std::uint32_t i = casters_[c];
    // a shadow on the ground shows less than the figure: a level with a quarter of its vertices
    const VisibleInstance& instance = geometry.instances[i];
    std::uint32_t level = Caster::kAllTriangles;
    std::uint32_t vertex_count = geometry.vertex_offset[i + 1] - geometry.vertex_offset[i];
    std::uint32_t triangle_count = drawn_[i].triangle_count;
    const std::uint32_t wanted =
        element::shadow_vertices(vertex_count, LevelTable::kMostVertices, shades_[i].size_px);
    if (wanted < vertex_count && !cast_->members[instance.character].environment) {
      const std::uint32_t coarser = levels_.level_at[instance.character][wanted];
      if (coarser < levels_.levels.size() &&
          levels_.levels[coarser].character == instance.character) {
        level = coarser;
        vertex_count = levels_.levels[coarser].vertex_count;
        triangle_count = levels_.levels[coarser].triangle_count;
      }
    }
    caster_shapes_[c] = {{}, vertices, vertex_count, indices, triangle_count, level};
    vertices += vertex_count;
    indices += 3 * triangle_count;
  }
  if (shadow_vertices_.size() < vertices) shadow_vertices_.resize(vertices + vertices / 2);
  if (shadow_indices_.size() < indices) shadow_indices_.resize(indices + indices / 2);
  shadow_projected_.resize(vertices);
  pool_.run(casters_.size(), [&](std::size_t c, unsigned) {
    const std::uint32_t i = casters_[c];
    Caster& caster = caster_shapes_[c];
    InstanceShade& shade = shades_[i];
    const std::uint32_t begin = geometry.vertex_offset[i];
    const std::uint32_t count = caster.vertices;
    for (std::uint32_t v = 0; v < count; ++v) {
      BatchVertex vertex = geometry.vertices[begin + v];
      const element::ShadowPoint point =
          element::shadow_point(scene, shade, vertex.position_relative);
      vertex.position_relative = point.position_relative;
      // kept for the depth plane below; shading never sees these vertices
      std::memcpy(&vertex.visible, &point.height_share, sizeof vertex.visible);
      shadow_vertices_[caster.first_vertex + v] = vertex;
    }
    std::uint32_t* out = shadow_indices_.data() + caster.first_index;
    if (caster.level == Caster::kAllTriangles) {
      const std::uint32_t* index = geometry.indices.data() + drawn_[i].first;
      const bool is_wall = shade.cast_shadow == kNoBlob;
      for (std::uint32_t t = 0; t < caster.triangles; ++t, index += 3) {
        const auto z = [&](int k) { return geometry.vertices[index[k]].position_relative.z; };
        const bool throws = !is_wall || element::throws_shadow(scene, z(0), z(1), z(2));
        // a floor's triangle becomes a point
        for (int k = 0; k < 3; ++k) {
          *out++ = index[throws ? k : 0] - begin + caster.first_vertex;
        }
      }
    } else {
      const std::uint32_t* corners =
          levels_.corners.data() + levels_.levels[caster.level].first_triangle;
      for (std::uint32_t t = 0; t < caster.triangles; ++t) {
        for (int k = 0; k < 3; ++k) *out++ = corner_of(corners[t], k) + caster.first_vertex;
      }
    }
    caster.footprint = project_vertices(grid_, shadow_vertices_.data(), caster.first_vertex,
                                        caster.first_vertex + count, shadow_projected_);
    if (caster.footprint.clipped) {
      if (shade.cast_shadow == kNoBlob) return;  // a wall: cut below
      // reaches behind the eye: a soft blob instead
      caster.footprint.x_high = caster.footprint.x_low - 1;
      shade.cast_shadow = 0.0F;
      return;
    }
    const float share = element::cast_shadow_share(scene, shade);
    // the plane keeps the strongest shadow, as the depth plane keeps the nearest surface
    for (std::uint32_t v = caster.first_vertex; v < caster.first_vertex + count; ++v) {
      float height_share = 0.0F;
      std::memcpy(&height_share, &shadow_vertices_[v].visible, sizeof height_share);
      shadow_projected_.depth[v] = element::cast_shadow_strength(share, height_share);
    }
  });
  for (std::size_t c = 0; c < casters_.size(); ++c) {
    if (caster_shapes_[c].footprint.clipped && shades_[casters_[c]].cast_shadow == kNoBlob) {
      cut_wall_shadow(scene, shades_[casters_[c]], caster_shapes_[c], vertices, indices);
    }
  }
}

/// Replaces a wall's triangles by what is left of them in front of the eye, after the used vertices
/// and indices.
void VisibilityRasterizer::cut_wall_shadow(const SceneFrame& scene, const InstanceShade& shade,
                                           Caster& caster, std::uint32_t& vertices,
                                           std::uint32_t& indices) {
  const float share = element::cast_shadow_share(scene, shade);
  const std::uint32_t first_index = indices;
  Footprint box{grid_.width, grid_.height, -1, -1, 1.0F, false};
  for (std::uint32_t t = 0; t < caster.triangles; ++t) {
    element::ShadowPoint corner[3];
    for (int k = 0; k < 3; ++k) {
      const BatchVertex& vertex =
          shadow_vertices_[shadow_indices_[caster.first_index + 3 * t + static_cast<unsigned>(k)]];
      corner[k].position_relative = vertex.position_relative;
      std::memcpy(&corner[k].height_share, &vertex.visible, sizeof corner[k].height_share);
    }
    element::SnappedVertex polygon[element::kMaxClippedCorners];
    const auto count =
        static_cast<std::uint32_t>(element::cut_shadow(grid_, corner, share, polygon));
    if (count < 3) continue;
    shadow_projected_.resize(vertices + count);
    if (shadow_indices_.size() < indices + 3 * count) shadow_indices_.resize(2 * indices + 64);
    for (std::uint32_t i = 0; i < count; ++i) {
      shadow_projected_.x[vertices + i] = polygon[i].x;
      shadow_projected_.y[vertices + i] = polygon[i].y;
      shadow_projected_.depth[vertices + i] = polygon[i].depth;
      shadow_projected_.inverse_w[vertices + i] = polygon[i].inverse_w;
      const int x = polygon[i].x >> element::kSubBits, y = polygon[i].y >> element::kSubBits;
      box.x_low = std::min(box.x_low, std::max(x, 0));
      box.y_low = std::min(box.y_low, std::max(y, 0));
      box.x_high = std::max(box.x_high, std::min(x, grid_.width - 1));
      box.y_high = std::max(box.y_high, std::min(y, grid_.height - 1));
      if (i < 2) continue;
      shadow_indices_[indices++] = vertices;
      shadow_indices_[indices++] = vertices + i - 1;
      shadow_indices_[indices++] = vertices + i;
    }
    vertices += count;
  }
  caster.footprint = box;
  caster.first_index = first_index;
  caster.triangles = (indices - first_index) / 3;
}

void VisibilityRasterizer::bin_shadows(const FrameGeometry& geometry, const SceneFrame& scene,
                                       const Viewport& viewport) {
  const std::size_t tiles = std::size_t{tiles_x_} * tiles_y_;
  const auto cover = [&](const auto& f, std::uint32_t value, auto&& place) {
    if (f.x_low > f.x_high || f.y_low > f.y_high) return;
    for (int ty = f.y_low / kTileSamples; ty <= f.y_high / kTileSamples; ++ty) {
      for (int tx = f.x_low / kTileSamples; tx <= f.x_high / kTileSamples; ++tx) {
        place(static_cast<std::size_t>(ty) * tiles_x_ + static_cast<std::size_t>(tx), value);
      }
    }
  };
  caster_bins_.fill(tiles, caster_shapes_.size(), pool_,
                    [&](std::size_t begin, std::size_t end, auto&& place) {
                      for (std::size_t c = begin; c < end; ++c) {
                        cover(caster_shapes_[c].footprint, static_cast<std::uint32_t>(c), place);
                      }
                    });
  if (blobs_.size() < count_) blobs_.resize(count_ + count_ / 2);
  constexpr std::size_t kChunk = 512;
  pool_.for_chunks(count_, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      BlobRecord& record = blobs_[i];
      record.blob = make_blob(scene, shades_[i]);
      record.place = element::blob_box(grid_, record.blob, scene.ground_relative_m);
      if (!geometry.representation.empty() && geometry.representation[i] == Representation::kNone) {
        record.place.x_high = record.place.x_low - 1;
      }
    }
  });
  blob_bins_.fill(tiles, count_, pool_, [&](std::size_t begin, std::size_t end, auto&& place) {
    for (std::size_t i = begin; i < end; ++i) {
      cover(blobs_[i].place, static_cast<std::uint32_t>(i), place);
    }
  });
}

/// Adds what an impostor shows at a sample; its weight and pixel are set by who calls.
void VisibilityRasterizer::add_relief(const FrameGeometry& geometry, std::uint32_t instance,
                                      std::uint32_t box, int sample_x, int sample_y,
                                      std::size_t sample, TileScratch& scratch) const {
  SurfaceItems& items = scratch.surface_items;
  const std::size_t n = items.count;
  const std::uint32_t texel = scratch.relief_texels[sample];
  const ReliefStore::Member& member = reliefs_.members[geometry.instances[instance].character];
  const element::ReliefHit hit = element::relief_hit(
      reliefs_.boxes[member.first_box + box], reliefs_.shape[texel], geometry.instances[instance],
      geometry.jointed[instance], geometry.joints.data(), relief_view_, sample_x, sample_y,
      scratch.planes.depth[sample]);
  items.instance[n] = static_cast<std::int32_t>(instance);
  items.base[n] = reliefs_.base[texel];
  items.regions[n] = reliefs_.regions[texel];
  for (int c = 0; c < 3; ++c) {
    items.normal[c][n] = hit.normal[c];
    items.relative[c][n] = hit.relative[c];
  }
}

/// Lists who may throw a shadow on the surroundings that are seen, by where they stand.
void VisibilityRasterizer::find_figures(const FrameGeometry& geometry, const SceneFrame& scene) {
  shades_surroundings_ =
      scene.shadows && std::any_of(casters_.begin(), casters_.end(), [&](std::uint32_t i) {
        return shades_[i].cast_shadow == kNoBlob;
      });
  if (!shades_surroundings_) return;
  sunward_ = element::sunward(scene);
  figure_first_.assign(element::FigureCells::kCount, element::FigureCells::kNobody);
  if (figure_next_.size() < count_) figure_next_.resize(count_ + count_ / 2);
  figures_ = {figure_first_.data(), figure_next_.data(), -1e9F};
  for (std::size_t i = 0; i < count_; ++i) {
    const InstanceShade& shade = shades_[i];
    if (shade.cast_shadow == kNoBlob) continue;
    if (!geometry.representation.empty() && geometry.representation[i] == Representation::kNone) {
      continue;
    }
    element::list_figure(figures_, shade, static_cast<std::uint32_t>(i));
  }
}

void VisibilityRasterizer::collect_items(const FrameGeometry& geometry, const SceneFrame& scene,
                                         int tile_x_px, int tile_y_px, int width, int height,
                                         TileScratch& scratch) const {
  scratch.figures.clear();
  scratch.flat_items.count = 0;
  scratch.surface_items.count = 0;
  const float* depth = scratch.planes.depth;
  const std::uint32_t* ids = scratch.planes.id;
  BlockKind kinds[kTileSamples / 4][kTileSamples / 4];
  classify_blocks(scratch.planes, &kinds[0][0]);
  const auto add = [&](int x, int y, std::uint32_t instance, std::uint32_t id, unsigned samples) {
    const DrawnInstance& drawn = drawn_[instance];
    const std::uint32_t triangle =
        (element::block_of(id) - drawn.first_block) * element::kBlockTriangles +
        element::triangle_of(id);
    if ((drawn.flags & DrawnInstance::kRelief) != 0) {
      const int k = __builtin_ctz(samples);  // of the pixel's samples the first one that shows it
      const int sample_x = 2 * x + (k & 1), sample_y = 2 * y + (k >> 1);
      SurfaceItems& surface = scratch.surface_items;
      add_relief(geometry, instance, triangle, 2 * tile_x_px + sample_x, 2 * tile_y_px + sample_y,
                 sample_index(sample_x, sample_y), scratch);
      surface.weight[surface.count] = kSamplePlaces[samples].weight;
      surface.pixel[surface.count++] = static_cast<std::uint16_t>(y * kTilePx + x);
      return;
    }
    const bool is_shared = (drawn.flags & DrawnInstance::kShared) != 0;
    const bool is_flat = (drawn.flags & DrawnInstance::kFlat) != 0;
    const std::uint32_t first = drawn.first + (is_shared ? triangle : 3 * triangle);
    const auto pixel = static_cast<std::uint16_t>(y * kTilePx + x);
    if (!is_flat) {
      if (!is_shared) __builtin_prefetch(geometry.indices.data() + first);
      unsigned shown = samples;
      if (shades_surroundings_ && shades_[instance].cast_shadow == kNoBlob) {
        glm::vec3 corner[3];
        for (unsigned k = 0; k < 3; ++k) {
          corner[k] = geometry.vertices[geometry.indices[first + k]].position_relative;
        }
        const SamplePlace& place = kSamplePlaces[samples];
        shown |= element::surface_shadow(scene, sunward_, figures_, shades_.data(), corner,
                                         static_cast<float>(tile_x_px + x) + place.x,
                                         static_cast<float>(tile_y_px + y) + place.y,
                                         scratch.missing[pixel])
                 << 4;
      }
      scratch.figures.add(instance, is_shared, {first, pixel, static_cast<std::uint16_t>(shown)});
      return;
    }
    ShadeItems& items = scratch.flat_items;
    const std::size_t n = items.count++;
    items.triangle[n] = static_cast<std::int32_t>(first);
    items.instance[n] = static_cast<std::int32_t>(instance);
    items.weight[n] = kSamplePlaces[samples].weight;
    items.pixel[n] = pixel;
  };
  for (int by = 0; 2 * by < height; ++by) {
    for (int bx = 0; 2 * bx < width; ++bx) {
      const BlockKind kind = kinds[by][bx];
      // a block's second row or column may lie beyond the picture: its items are not asked for
      const int last_x = std::min(2 * bx + 1, width - 1), last_y = std::min(2 * by + 1, height - 1);
      for (int y = 2 * by; y <= last_y; ++y) {
        for (int x = 2 * bx; x <= last_x; ++x) {
          float& background = scratch.background_share[y * kTilePx + x];
          const std::size_t at = sample_index(2 * x, 2 * y);
          if (kind == BlockKind::kEmpty) {
            background = 1.0F;
            continue;
          }
          if (kind == BlockKind::kOneTriangle) {
            background = 0.0F;
            if (element::class_of(ids[at]) != element::SampleClass::kPoint)
              add(x, y, block_instance_[element::block_of(ids[at])], ids[at], 15);
            continue;
          }
          const std::size_t places[4] = {at, at + 1, at + 4, at + 5};
          std::uint32_t instance_of[4] = {};
          unsigned rest = 0, covered = 0;
          for (unsigned k = 0; k < 4; ++k) {
            const bool is_here = depth[places[k]] != 0.0F;
            covered |= static_cast<unsigned>(is_here) << k;
            if (element::class_of(ids[places[k]]) == element::SampleClass::kPoint) continue;
            rest |= static_cast<unsigned>(is_here) << k;
            // ids where nothing is are 0: a block that exists
            instance_of[k] = block_instance_[element::block_of(ids[places[k]])];
          }
          background = 1.0F - kSamplePlaces[covered].weight;
          while (rest != 0) {
            const int first = __builtin_ctz(rest);
            unsigned same = 0;
            for (unsigned k = 0; k < 4; ++k) {
              same |= static_cast<unsigned>(instance_of[k] == instance_of[first]) << k;
            }
            same &= rest;
            rest &= ~same;
            add(x, y, instance_of[first], ids[places[first]], same);
          }
        }
      }
    }
  }
}

void VisibilityRasterizer::collect_facts(int tile_x_px, int tile_y_px, int width, int height,
                                         int picture_width, std::span<const Splat> splats,
                                         const TilePlanes& planes) const {
  for (int y = 0; y < height; ++y) {
    const auto row =
        static_cast<std::size_t>(tile_y_px + y) * static_cast<std::size_t>(picture_width);
    for (int x = 0; x < width; ++x) {
      const std::size_t at = sample_index(2 * x, 2 * y);
      const std::size_t places[4] = {at, at + 1, at + 4, at + 5};
      std::uint32_t shown[4];
      for (int k = 0; k < 4; ++k) {
        const std::uint32_t id = planes.id[places[k]];
        if (planes.depth[places[k]] == 0.0F) {
          shown[k] = PixelFacts::kNothing;
        } else if (element::class_of(id) == element::SampleClass::kPoint) {
          const std::uint32_t visible = splats[SplatStage::number_of(id)].visible;
          shown[k] = visible == kNobody ? PixelFacts::kNothing : visible;
        } else {
          shown[k] = block_instance_[element::block_of(id)];
        }
      }
      std::uint32_t best = PixelFacts::kNothing;
      int best_count = 0;
      float best_depth = -1.0F;
      for (int k = 0; k < 4; ++k) {
        int count = 0;
        float nearest = 0.0F;
        for (int other = 0; other < 4; ++other) {
          if (shown[other] != shown[k]) continue;
          ++count;
          nearest = std::max(nearest, planes.depth[places[other]]);
        }
        if (count < best_count || (count == best_count && nearest <= best_depth)) continue;
        best = shown[k];
        best_count = count;
        best_depth = nearest;
      }
      const std::size_t pixel = row + static_cast<std::size_t>(tile_x_px + x);
      facts_->instance[pixel] = best;
      facts_->depth[pixel] = best_depth;
    }
  }
}

/// Share of the ground's light that shadows take, but for specks'.
void VisibilityRasterizer::collect_missing(const SceneFrame& scene, std::size_t tile, int tile_x_px,
                                           int tile_y_px, int width, int height,
                                           TileScratch& scratch) const {
  std::memset(scratch.missing, 0, sizeof(scratch.missing));
  if (scene.shadows && count_ > 0) {
    const std::span<const std::uint32_t> casters = caster_bins_.of(tile);
    if (!casters.empty()) {
      clear_tile(scratch.shadow);
      TileCounters ignored;
      for (const std::uint32_t c : casters) {
        const Caster& caster = caster_shapes_[c];
        const InstanceTriangles triangles{shadow_indices_.data() + caster.first_index,
                                          caster.triangles, 0, true, false};
        draw_instance(triangles, shadow_projected_, shadow_vertices_.data(), grid_, tile_x_px * 2,
                      tile_y_px * 2, scratch.shadow, ignored);
      }
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const float* d = scratch.shadow.depth + sample_index(2 * x, 2 * y);
          scratch.missing[y * kTilePx + x] = 0.25F * (((d[0] + d[1]) + d[4]) + d[5]);
        }
      }
    }
    const std::span<const std::uint32_t> list = blob_bins_.of(tile);
    for (std::size_t k = 0; k < list.size(); ++k) {
      if (k + 4 < list.size()) __builtin_prefetch(&blobs_[list[k + 4]]);
      const BlobRecord& record = blobs_[list[k]];
      const element::SampleBox& f = record.place;
      const int x0 = std::max(0, f.x_low / 2 - tile_x_px),
                x1 = std::min(width - 1, f.x_high / 2 - tile_x_px);
      const int y0 = std::max(0, f.y_low / 2 - tile_y_px),
                y1 = std::min(height - 1, f.y_high / 2 - tile_y_px);
      if (x0 > x1 || y0 > y1) continue;
      // whole vectors of the tile: they start where the tile does, so no pixel depends on f
      const int from = x0 & ~15;
      shade_blob(scene, record.blob, tile_x_px + from, tile_y_px + y0, ((x1 | 15) - from) + 1,
                 y1 - y0 + 1, kTilePx, scratch.missing + y0 * kTilePx + from);
    }
  }
}

void VisibilityRasterizer::add_background(const SceneFrame& scene, std::size_t tile, int tile_x_px,
                                          int tile_y_px, int width, int height,
                                          TileScratch& scratch,
                                          const FrameGeometry& geometry) const {
  if (scene.shadows && specks_.any(tile)) {
    specks_.shade(tile, tile_x_px, tile_y_px, geometry, scratch.speck, scratch.missing);
  }
  if (splat_shadows_.any(tile)) {
    splat_shadows_.shade(tile, tile_x_px, tile_y_px, shadows_of(geometry), scratch.speck,
                         scratch.missing);
  }
  for (int y = 0; y < height; ++y) {
    const float* share = scratch.background_share + y * kTilePx;
    bool any = false;
    for (int x = 0; x < width; ++x) any |= share[x] > 0.0F;
    if (!any) continue;
    shade_background(scene, tile_x_px, tile_y_px + y, kTilePx, scratch.row[0], scratch.row[1],
                     scratch.row[2]);
    for (int c = 0; c < 3; ++c) {
      float* out = scratch.rgb[c] + y * kTilePx;
      const float* missing = scratch.missing + y * kTilePx;
      for (int x = 0; x < width; ++x)
        out[x] += share[x] * (scratch.row[c][x] * (1.0F - missing[x]));
    }
  }
}

/// What is behind specks is seen through them; what they show is added.
void VisibilityRasterizer::blend_specks(const FrameGeometry& geometry, std::size_t tile,
                                        int tile_x_px, int tile_y_px, bool has_planes,
                                        TileScratch& scratch) const {
  const TilePlanes& planes = scratch.planes;
  specks_.draw(tile, tile_x_px, tile_y_px, geometry, speck_scene_, has_planes ? &planes : nullptr,
               scratch.speck, scratch.specks);
  for (int y = 0; y < kTilePx; ++y) {
    for (int x = 0; x < kTilePx; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * kTilePx + static_cast<std::size_t>(x);
      const std::size_t at = sample_index(2 * x, 2 * y);
      const float* through = scratch.specks.through + at;
      float background = 0.0F, figures = 0.0F, covered = 0.0F;
      for (const std::size_t k : {0, 1, 4, 5}) {
        const bool is_figure = has_planes && planes.depth[at + k] != 0.0F;
        (is_figure ? figures : background) += through[k];
        covered += is_figure ? 1.0F : 0.0F;
      }
      scratch.background_share[pixel] = 0.25F * background;
      const float kept = covered > 0.0F ? figures / covered : 1.0F;
      for (int c = 0; c < 3; ++c) {
        scratch.rgb[c][pixel] = scratch.rgb[c][pixel] * kept + scratch.specks.rgb[pixel][c];
      }
    }
  }
}

FrameGeometry VisibilityRasterizer::shadows_of(const FrameGeometry& geometry) const {
  FrameGeometry shadows;
  shadows.specks = geometry.shadows;
  shadows.speck_runs = shadow_runs_;
  shadows.speck_table = &shadow_table_;
  return shadows;
}

void VisibilityRasterizer::place_shadows(const FrameGeometry& geometry) {
  constexpr std::uint32_t kRun = 4096;
  if (shadow_table_.image.empty()) shadow_table_.image.push_back({-0.2F, 0.2F, 0.0F, 1.0F});
  shadow_runs_.clear();
  const auto count = static_cast<std::uint32_t>(geometry.shadows.size());
  for (std::uint32_t i = 0; i < count; i += kRun) {
    shadow_runs_.push_back({i, std::min(kRun, count - i)});
  }
  splat_shadows_.place(shadows_of(geometry), speck_scene_, tiles_x_, tiles_y_, pool_);
}

void VisibilityRasterizer::prefetch(const FrameGeometry& geometry,
                                    const DrawnInstance& drawn) const {
  if ((drawn.flags & DrawnInstance::kShared) == 0) return;
  constexpr std::uint32_t kLine = 16;  // values of a cache line
  const float* posed = geometry.posed + drawn.shared.posed;
  for (std::uint32_t k = 0; k < drawn.shared.vertex_count; k += kLine) {
    for (std::uint32_t column = 0; column < 3; ++column) {
      __builtin_prefetch(posed + column * drawn.shared.stride + k);
    }
  }
}

void VisibilityRasterizer::draw_tile(const FrameGeometry& geometry, const SceneFrame& scene,
                                     const Viewport& viewport, std::size_t tile,
                                     TileScratch& scratch, Picture& picture) const {
  const int tile_x_px = static_cast<int>(tile % tiles_x_) * kTilePx;
  const int tile_y_px = static_cast<int>(tile / tiles_x_) * kTilePx;
  const int width = std::min(kTilePx, static_cast<int>(viewport.width_px) - tile_x_px);
  const int height = std::min(kTilePx, static_cast<int>(viewport.height_px) - tile_y_px);
  const int tile_x = tile_x_px * 2, tile_y = tile_y_px * 2;

  const bool has_splats = splats_.any(tile);
  const bool may_draw = count_ > 0 && !bins_.of(tile).empty();
  const bool has_specks = specks_.any(tile);
  if (may_draw || has_splats) clear_tile(scratch.planes);
  bool empty = !has_splats;
  if (may_draw) {
    const std::span<const std::uint64_t> list = bins_.of(tile);
    // near to far, so that what is hidden is known to be when its turn comes
    std::vector<std::uint64_t>& order = scratch.order;
    order.assign(list.begin(), list.end());
    std::sort(order.begin(), order.end());
    const auto drawn_at = [&](std::size_t k) -> const DrawnInstance& {
      return drawn_[static_cast<std::uint32_t>(order[k])];
    };
    std::uint64_t since_refresh = 0;
    for (std::size_t k = 0; k < order.size(); ++k) {
      if (k + 4 < order.size()) __builtin_prefetch(&drawn_at(k + 4));
      if (k + 2 < order.size()) prefetch(geometry, drawn_at(k + 2));
      const DrawnInstance& drawn = drawn_at(k);
      if (occlusion_ && (drawn.flags & DrawnInstance::kClipped) == 0 &&
          hidden(scratch.planes, std::max(drawn.x_low - tile_x, 0),
                 std::max(drawn.y_low - tile_y, 0),
                 std::min(drawn.x_high - tile_x, kTileSamples - 1),
                 std::min(drawn.y_high - tile_y, kTileSamples - 1), drawn.depth_high)) {
        ++scratch.counters.hidden;
        continue;
      }
      if ((drawn.flags & DrawnInstance::kRelief) != 0) {
        draw_relief(reliefs_, reliefs_.members[drawn.flags & DrawnInstance::kCharacter],
                    placed_.data() + drawn.first, drawn.first_block, relief_view_, relief_search_,
                    tile_x, tile_y, scratch.planes, scratch.relief_texels, scratch.counters);
        since_refresh += 7 * drawn.triangle_count;  // of boxes: a dozen triangles each
      } else if ((drawn.flags & DrawnInstance::kShared) != 0) {
        draw_shared(shared_triangles(geometry, drawn), grid_, tile_x, tile_y, scratch.shared,
                    scratch.planes, scratch.counters);
      } else if ((drawn.flags & DrawnInstance::kListed) != 0) {
        draw_listed(lists_[drawn.listed.list], drawn.listed.small, drawn.listed.large,
                    drawn.first_block, (drawn.flags & DrawnInstance::kDoubleSided) != 0, tile_x,
                    tile_y, scratch.planes, scratch.counters);
      } else {
        draw_instance(own_triangles(geometry, drawn, (drawn.flags & DrawnInstance::kClipped) != 0),
                      projected_, geometry.vertices.data(), grid_, tile_x, tile_y, scratch.planes,
                      scratch.counters);
      }
      ++scratch.counters.instances;
      since_refresh += drawn.triangle_count;
      if (since_refresh >= kCellRefreshTriangles) {
        update_cells(scratch.planes);
        since_refresh = 0;
      }
      empty = false;
    }
  }
  if (has_splats) splats_.draw(tile, tile_x, tile_y, scratch.planes);
  if (empty && !has_specks && !splat_shadows_.any(tile) &&
      (!scene.shadows || count_ == 0 ||
       (blob_bins_.of(tile).empty() && caster_bins_.of(tile).empty()))) {
    for (int y = 0; y < height; ++y) {
      shade_background(scene, tile_x_px, tile_y_px + y, kTilePx, scratch.row[0], scratch.row[1],
                       scratch.row[2]);
      encode_row(
          scratch.row[0], scratch.row[1], scratch.row[2], width,
          picture.rgbx.data() + 4 * (static_cast<std::size_t>(tile_y_px + y) * picture.width_px +
                                     static_cast<std::size_t>(tile_x_px)));
    }
    return;
  }
  std::memset(scratch.rgb, 0, sizeof(scratch.rgb));
  collect_missing(scene, tile, tile_x_px, tile_y_px, width, height, scratch);
  if (empty) {
    std::fill(scratch.background_share, scratch.background_share + kPixels, 1.0F);
  } else {
    collect_items(geometry, scene, tile_x_px, tile_y_px, width, height, scratch);
    if (facts_ != nullptr) {
      collect_facts(tile_x_px, tile_y_px, width, height, static_cast<int>(viewport.width_px),
                    geometry.splats, scratch.planes);
    }
    const SharedMeshes shared{geometry.posed,        levels_.corners.data(), uv_.data(),
                              shared_shades_.data(), tones_.data(),          corner_tones_.data(),
                              tone_shift_.data()};
    scratch.figures.sort();
    float* const planes[3] = {scratch.rgb[0], scratch.rgb[1], scratch.rgb[2]};
    shade_figures(scene, geometry, shared, shades_.data(), textures_, scratch.figures, tile_x_px,
                  tile_y_px, planes);
    scratch.counters.shaded += scratch.figures.count();
    shade_flat_items(scene, shared, shades_.data(), scratch.flat_items);
    shade_surface_items(scene, shades_.data(), scratch.surface_items);
    const auto add_colors = [&scratch](const auto& items) {
      scratch.counters.shaded += items.count;
      for (std::size_t n = 0; n < items.count; ++n) {
        const std::size_t pixel = items.pixel[n];
        for (int c = 0; c < 3; ++c) scratch.rgb[c][pixel] += items.weight[n] * items.rgb[c][n];
      }
    };
    add_colors(scratch.flat_items);
    add_colors(scratch.surface_items);
    if (has_splats) {
      SplatStage::collect(scratch.planes, geometry.splats, scene, width, height,
                          static_cast<std::uint32_t>(count_), scratch.splat_items);
      shade_surface_items(scene, shades_.data(), scratch.splat_items);
      add_colors(scratch.splat_items);
    }
  }
  if (has_specks) blend_specks(geometry, tile, tile_x_px, tile_y_px, !empty, scratch);
  add_background(scene, tile, tile_x_px, tile_y_px, width, height, scratch, geometry);
  for (int y = 0; y < height; ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * kTilePx;
    encode_row(
        scratch.rgb[0] + row, scratch.rgb[1] + row, scratch.rgb[2] + row, width,
        picture.rgbx.data() + 4 * (static_cast<std::size_t>(tile_y_px + y) * picture.width_px +
                                   static_cast<std::size_t>(tile_x_px)));
  }
}

absl::Status VisibilityRasterizer::draw(const FrameGeometry& geometry, const Camera& camera,
                                        const Viewport& viewport, const glm::dvec3& origin_world,
                                        const Look& look, Picture& picture) {
  if (absl::Status status = check(geometry, viewport); !status.ok()) return status;
  try {
    picture.width_px = viewport.width_px;
    picture.height_px = viewport.height_px;
    picture.rgbx.resize(std::size_t{4} * viewport.width_px * viewport.height_px);
    grid_.clip_from_relative = clip_from_relative(camera, viewport);
    grid_.width = static_cast<std::int32_t>(2 * viewport.width_px);
    grid_.height = static_cast<std::int32_t>(2 * viewport.height_px);
    tiles_x_ = (viewport.width_px + kTilePx - 1) / kTilePx;
    tiles_y_ = (viewport.height_px + kTilePx - 1) / kTilePx;
    const SceneFrame scene = make_scene_frame(camera, viewport, origin_world, look);
    relief_view_ = make_relief_view(scene, grid_);
    relief_search_ = look.relief_search;
    relief_search_.linear_steps = std::clamp(relief_search_.linear_steps, 1U, 1024U);
    relief_search_.binary_steps = std::min(relief_search_.binary_steps, 32U);
    count_ = geometry.instances.size();
    shades_surroundings_ = false;
    for (auto& one : scratch_) one->counters = {};
    if (count_ > 0) {
      if (absl::Status status = number_blocks(geometry); !status.ok()) return status;
      shade_instances(geometry, *cast_, scene, look, pool_, shades_, casters_);
      prepare(geometry);
      bin();
      find_figures(geometry, scene);
      if (scene.shadows) {
        project_shadows(geometry, scene);
        bin_shadows(geometry, scene, viewport);
      }
    }
    if (facts_ != nullptr) {
      // tiles without a figure leave it so
      facts_->depth.assign(std::size_t{viewport.width_px} * viewport.height_px, 0.0F);
      facts_->instance.assign(facts_->depth.size(), PixelFacts::kNothing);
      facts_->bounds.resize(count_);
      for (std::size_t i = 0; i < count_; ++i) {
        const DrawnInstance& drawn = drawn_[i];
        if (drawn.x_low > drawn.x_high) {
          facts_->bounds[i] = {};
          continue;
        }
        facts_->bounds[i] = {drawn.x_low / 2, drawn.y_low / 2, drawn.x_high / 2, drawn.y_high / 2};
      }
    }
    splats_.clear();
    if (!geometry.splats.empty()) {
      if (block_instance_.empty()) block_instance_.resize(1);  // of samples where nothing is
      // the light of splats of nobody
      if (count_ == 0) shades_.clear();
      shades_.push_back(InstanceShade{});
      shades_.back().feet_relative.z = scene.ground_relative_m;
      shades_.back().channel = kNoChannel;
      splats_.place(geometry.splats, grid_, scene, glm::mat3(view_from_relative(camera)), tiles_x_,
                    tiles_y_, pool_);
    }
    specks_.clear();
    splat_shadows_.clear();
    if (!geometry.speck_runs.empty() || !geometry.shadows.empty()) {
      speck_scene_ = {&scene,
                      &grid_,
                      glm::vec3(glm::transpose(glm::mat3(view_from_relative(camera)))[1]),
                      geometry.speck_detail,
                      {look.channel_low, look.channel_high, look.color_by_channel, look.color_map}};
    }
    if (!geometry.speck_runs.empty()) {
      specks_.place(geometry, speck_scene_, tiles_x_, tiles_y_, pool_);
    }
    if (!geometry.shadows.empty() && scene.shadows) place_shadows(geometry);
    pool_.run(std::size_t{tiles_x_} * tiles_y_, [&](std::size_t tile, unsigned worker) {
      draw_tile(geometry, scene, viewport, tile, *scratch_[worker], picture);
    });
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "visibility draw: no memory for ", viewport.width_px, "x", viewport.height_px, " px"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Rasterizer>> make_visibility_rasterizer(unsigned threads,
                                                                       std::string why,
                                                                       bool occlusion) {
  try {
    return std::unique_ptr<Rasterizer>(
        std::make_unique<VisibilityRasterizer>(threads, std::move(why), occlusion));
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("make_rasterizer: no memory for the tiles");
  }
}

}  // namespace throng::render::visibility
