#include "render/raster/visibility/cuda/cuda_rasterizer.hpp"

#include <absl/cleanup/cleanup.h>
#include <absl/strings/str_cat.h>
#include <cuda_runtime_api.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <utility>
#include <vector>

#include "render/compute/cpu/levels.hpp"
#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/cuda/device.hpp"
#include "render/compute/cuda/device_frame.hpp"
#include "render/compute/cuda/graph.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/cuda/memory.hpp"
#include "render/compute/cuda/stage_events.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/relief.hpp"
#include "render/raster/visibility/cpu/shade.hpp"
#include "render/raster/visibility/cuda/device_picture.hpp"
#include "render/raster/visibility/cuda/launch.hpp"
#include "render/raster/visibility/element/word.hpp"

namespace throng::render::visibility {
namespace cuda {
namespace {

using render::cuda::DeviceBuffer;
using render::cuda::DeviceFrame;
using render::cuda::PinnedBuffer;

constexpr std::uint32_t kMaxSidePx = 16384;
constexpr char kUpload[] = "visibility (cuda) upload";
constexpr char kDraw[] = "visibility (cuda) draw";
static_assert(kMostLevelVertices == LevelTable::kMostVertices);

class CudaRasterizer final : public Rasterizer {
 public:
  static absl::StatusOr<std::unique_ptr<Rasterizer>> make() {
    constexpr char kCall[] = "make_rasterizer: cuda";
    const auto device = render::cuda::open_device(kCall);
    if (!device.ok()) return device.status();
    auto rasterizer = std::unique_ptr<CudaRasterizer>(new CudaRasterizer(*device));
    THRONG_CUDA_TRY(cudaStreamCreateWithFlags(&rasterizer->stream_, cudaStreamNonBlocking), kCall);
    THRONG_CUDA_TRY(cudaEventCreateWithFlags(&rasterizer->ready_, cudaEventDisableTiming), kCall);
    for (cudaEvent_t* event : {&rasterizer->began_, &rasterizer->ended_}) {
      THRONG_CUDA_TRY(cudaEventCreate(event), kCall);
    }
    rasterizer->buffers_ = std::make_unique<Buffers>(rasterizer->stream_);
    return rasterizer;
  }

  ~CudaRasterizer() override {
    for (cudaEvent_t event : {ready_, began_, ended_}) {
      if (event != nullptr) cudaEventDestroy(event);
    }
    // memory is given back in the order of the stream, so the stream goes last
    buffers_.reset();
    if (stream_ != nullptr) {
      cudaStreamSynchronize(stream_);
      cudaStreamDestroy(stream_);
    }
  }

  RasterInfo info() const override {
    return {absl::StrCat("visibility (cuda, ", device_name_, ")"),
            absl::StrCat("CUDA visibility rasterizer, ", device_name_,
                         ", 4 samples a pixel; JPEG by ", jpeg_encoder_name())};
  }
  bool takes_device() const override { return true; }
  bool takes_fused() const override { return true; }
  bool draws(Representation form) const override { return form <= Representation::kSpeck; }
  RasterCounters counters() const override { return counters_; }
  absl::Status keep_facts(PixelFacts* facts) override {
    facts_ = facts;
    return absl::OkStatus();
  }

  absl::Status upload(std::shared_ptr<const Cast> cast) override;
  absl::Status draw(const FrameGeometry& geometry, const Camera& camera, const Viewport& viewport,
                    const glm::dvec3& origin_world, const Look& look, Picture& picture) override;

 private:
  struct Buffers {
    explicit Buffers(cudaStream_t s)
        : character(s),
          texels(s),
          flags(s),
          level(s),
          level_corners(s),
          level_at(s),
          uv(s),
          tones(s),
          band(s),
          corner_tones(s),
          relief_member(s),
          relief_box(s),
          relief_shape(s),
          relief_base(s),
          relief_regions(s),
          instance(s),
          vertex_offset(s),
          triangle_offset(s),
          vertices(s),
          indices(s),
          representation(s),
          jointed(s),
          joints(s),
          splats(s),
          specks(s),
          specks_and_shadows(s),
          speck_image(s),
          speck_slab(s),
          placed_specks(s),
          first_entry(s),
          first_of_tile(s),
          nearest(s),
          farthest(s),
          speck_key{DeviceBuffer<Word>(s), DeviceBuffer<Word>(s)},
          speck_number{DeviceBuffer<std::uint32_t>(s), DeviceBuffer<std::uint32_t>(s)},
          speck_light(s),
          speck_through(s),
          shade(s),
          block_count(s),
          first_block(s),
          block_instance(s),
          own_blocks(s),
          small_units(s),
          large_units(s),
          projected(s),
          special(s),
          large(s),
          tiles(s),
          candidates(s),
          casters(s),
          blobs(s),
          blob_tiles(s),
          counts(s),
          words(s),
          shadow(s),
          blob_shadow(s),
          figure_first(s),
          figure_next(s),
          fact_depth(s),
          fact_instance(s),
          fact_bounds(s),
          scratch(s) {}
    // the cast
    DeviceBuffer<RasterCharacter> character;
    DeviceBuffer<std::uint32_t> texels;
    DeviceBuffer<std::uint8_t> flags;
    DeviceBuffer<RasterLevel> level;
    DeviceBuffer<std::uint32_t> level_corners, level_at, uv;
    DeviceBuffer<TriangleTone> tones;
    DeviceBuffer<ToneBand> band;
    DeviceBuffer<std::uint32_t> corner_tones;
    DeviceBuffer<ReliefMember> relief_member;
    DeviceBuffer<ReliefBox> relief_box;
    DeviceBuffer<std::uint32_t> relief_shape, relief_base, relief_regions;
    // geometry that came from the host
    DeviceBuffer<VisibleInstance> instance;
    DeviceBuffer<std::uint32_t> vertex_offset, triangle_offset;
    DeviceBuffer<BatchVertex> vertices;
    DeviceBuffer<std::uint32_t> indices;
    DeviceBuffer<Representation> representation;
    DeviceBuffer<JointedInstance> jointed;
    DeviceBuffer<float> joints;
    DeviceBuffer<Splat> splats;
    DeviceBuffer<Speck> specks, specks_and_shadows;
    DeviceBuffer<SpeckImage> speck_image;  // of `speck_cast_`
    DeviceBuffer<SpeckSlab> speck_slab;
    // the frame's
    DeviceBuffer<element::PlacedSpeck> placed_specks;
    DeviceBuffer<std::uint32_t> first_entry, first_of_tile, nearest, farthest;
    DeviceBuffer<Word> speck_key[2];
    DeviceBuffer<std::uint32_t> speck_number[2];
    DeviceBuffer<glm::vec4> speck_light;
    DeviceBuffer<float> speck_through;
    DeviceBuffer<InstanceShade> shade;
    DeviceBuffer<std::uint32_t> block_count, first_block, block_instance;
    DeviceBuffer<std::uint32_t> own_blocks, small_units, large_units;
    DeviceBuffer<element::SnappedVertex> projected;
    DeviceBuffer<std::uint32_t> special;
    DeviceBuffer<LargeTriangle> large;
    DeviceBuffer<glm::uvec2> tiles;
    DeviceBuffer<Candidate> candidates;
    DeviceBuffer<std::uint32_t> casters;
    DeviceBuffer<BlobRecord> blobs;
    DeviceBuffer<glm::uvec2> blob_tiles;
    DeviceBuffer<RasterCounts> counts;
    DeviceBuffer<Word> words;
    DeviceBuffer<std::uint32_t> shadow, blob_shadow, figure_first, figure_next;
    DeviceBuffer<float> fact_depth;
    DeviceBuffer<std::uint32_t> fact_instance;
    DeviceBuffer<FactBox> fact_bounds;
    DeviceBuffer<std::byte> scratch;
    PinnedBuffer read_back;     // the counts
    PinnedBuffer read_entries;  // how many entries the lists of specks have

    std::uint64_t size_bytes() const {
      const auto sum = [](const auto&... buffer) { return (buffer.size_bytes() + ...); };
      return sum(character, texels, flags, level, level_corners, level_at, uv, tones, band,
                 corner_tones, relief_member, relief_box, relief_shape, relief_base, relief_regions,
                 representation, jointed, joints, splats, specks, specks_and_shadows, speck_image,
                 speck_slab, placed_specks, first_entry, first_of_tile, nearest, farthest,
                 speck_key[0], speck_key[1], speck_number[0], speck_number[1], speck_light,
                 speck_through, own_blocks, small_units, large_units, instance, vertex_offset,
                 triangle_offset, vertices, indices, shade, block_count, first_block,
                 block_instance, projected, special, large, tiles, candidates, casters, blobs,
                 blob_tiles, counts, words, shadow, blob_shadow, figure_first, figure_next,
                 fact_depth, fact_instance, fact_bounds, scratch);
    }
  };

  explicit CudaRasterizer(int device)
      : device_(device), device_name_(render::cuda::device_name(device)) {}

  /// Room for `count` values, which kernels find through `to`.
  template <typename T>
  static cudaError_t give(DeviceBuffer<T>& buffer, std::size_t count, T*& to) {
    const cudaError_t error = buffer.resize(count);
    to = buffer.data();
    return error;
  }
  /// The same with values from the host.
  template <typename T>
  cudaError_t copy(const T* from, std::size_t count, DeviceBuffer<T>& buffer, const T*& to) {
    const cudaError_t error = buffer.resize(std::max<std::size_t>(count, 1));
    to = buffer.data();
    if (error != cudaSuccess || count == 0) return error;
    return cudaMemcpyAsync(buffer.data(), from, count * sizeof(T), cudaMemcpyHostToDevice, stream_);
  }

  absl::Status check(const FrameGeometry& geometry, const Viewport& viewport) const;
  absl::Status take_geometry(const FrameGeometry& geometry, RasterJob& job);
  absl::Status take_splats(std::span<const Splat> splats, RasterJob& job);
  absl::Status take_specks(const FrameGeometry& geometry, RasterJob& job);
  absl::Status take_shadows(const FrameGeometry& geometry, RasterJob& job);
  absl::Status place_specks(RasterJob& job);
  absl::Status make_room(RasterJob& job, std::uint32_t most_blocks);
  absl::Status run(const RasterJob& job, std::uint32_t most_blocks, cudaStream_t stream,
                   bool recorded);
  absl::StatusOr<std::shared_ptr<CudaPicture>> free_picture();
  absl::Status read_facts(const RasterJob& job);
  void take_counts();

  int device_;
  cudaStream_t stream_ = nullptr;
  cudaEvent_t ready_ = nullptr;                    // what the backend made
  cudaEvent_t began_ = nullptr, ended_ = nullptr;  // for the time
  std::string device_name_;
  std::shared_ptr<const Cast> cast_;
  std::shared_ptr<const CastTable> speck_cast_;  // whose pictures the processor handed over last
  std::unique_ptr<Buffers> buffers_;
  RasterCast device_cast_;
  RasterCounters counters_;
  render::cuda::LaunchGraph graph_;
  enum Moment : std::size_t { kBegun, kShadowsEnd, kTrianglesEnd, kResolveEnds, kMoments };
  render::cuda::StageEvents<kMoments> moments_;
  PixelFacts* facts_ = nullptr;                         // null: nobody asks
  std::vector<std::shared_ptr<CudaPicture>> pictures_;  // those that nobody else has are free
  bool counts_pending_ = false;                         // of the frame before
};

absl::Status CudaRasterizer::upload(std::shared_ptr<const Cast> cast) {
  if (cast == nullptr || cast->members.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(kUpload, ": the cast is empty"));
  }
  THRONG_CUDA_TRY(cudaSetDevice(device_), kUpload);  // the current one is the thread's
  absl::StatusOr<TextureStore> textures = make_textures(*cast);
  if (!textures.ok()) return textures.status();
  const LevelTable levels = make_levels(*cast);
  RasterCast device;
  device.first_surrounding = static_cast<std::uint32_t>(cast->members.size());
  std::vector<RasterCharacter> characters;
  std::vector<std::uint8_t> flags;
  std::vector<std::uint32_t> level_at, uv, corner_tones;
  const std::vector<TriangleTone> tones = make_tones(*cast, levels, *textures);
  std::vector<ToneBand> bands;
  for (std::size_t m = 0; m < cast->members.size(); ++m) {
    const CastMember& member = cast->members[m];
    RasterCharacter& character = characters.emplace_back();
    character.texture = textures->infos[m];
    character.height_m = member.character.height_m;
    character.first_uv = static_cast<std::uint32_t>(uv.size());
    for (const glm::u16vec2& one : member.character.uv) {
      uv.push_back(std::uint32_t{one.x} | std::uint32_t{one.y} << 16);
    }
    const CornerTones& own_tones = member.character.corner_tones;
    character.toned_count = own_tones.most_vertices();
    character.first_band = static_cast<std::uint32_t>(bands.size());
    character.band_count = static_cast<std::uint32_t>(own_tones.band.size());
    const auto first_triangle = static_cast<std::uint32_t>(corner_tones.size() / 3);
    for (const ToneBand& band : own_tones.band) {
      bands.push_back({band.vertex_count, first_triangle + band.first});
    }
    corner_tones.insert(corner_tones.end(), own_tones.tone.begin(), own_tones.tone.end());
    character.first_flag = static_cast<std::uint32_t>(flags.size());
    for (const std::uint8_t flag : member.character.triangle_flags) {
      if ((flag & kTriangleDoubleSided) != 0) character.flags |= RasterCharacter::kDoubleSided;
      if ((flag & kTriangleAlphaCutout) != 0) character.flags |= RasterCharacter::kHoles;
      flags.push_back(flag);
    }
    if (member.environment) {
      character.flags |= RasterCharacter::kSurrounding;
      device.first_surrounding = std::min(device.first_surrounding, static_cast<std::uint32_t>(m));
    }
    for (std::uint32_t n = 0; n <= kMostLevelVertices; ++n) {
      const std::uint32_t level = n < levels.level_at[m].size() ? levels.level_at[m][n] : kNoLevel;
      level_at.push_back(
          level < levels.levels.size() && levels.levels[level].character == m ? level : kNoLevel);
    }
  }
  absl::StatusOr<ReliefStore> reliefs = make_relief_store(*cast);
  if (!reliefs.ok()) return reliefs.status();
  static_assert(sizeof(ReliefMember) == sizeof(ReliefStore::Member));
  std::vector<ReliefMember> relief_members;
  for (const ReliefStore::Member& member : reliefs->members) {
    relief_members.push_back({member.first_box, member.box_count});
  }
  std::vector<RasterLevel> device_levels;
  for (const Level& level : levels.levels) {
    device_levels.push_back({level.vertex_count, level.triangle_count, level.first_triangle});
  }
  // from here on the cast before is no longer whole: should this one fail there is none
  cast_.reset();
  device_cast_ = {};
  Buffers& b = *buffers_;
  THRONG_CUDA_TRY(copy(characters.data(), characters.size(), b.character, device.character),
                  kUpload);
  THRONG_CUDA_TRY(copy(textures->texels.data(), textures->texels.size(), b.texels, device.texels),
                  kUpload);
  THRONG_CUDA_TRY(copy(flags.data(), flags.size(), b.flags, device.triangle_flags), kUpload);
  THRONG_CUDA_TRY(copy(device_levels.data(), device_levels.size(), b.level, device.level), kUpload);
  THRONG_CUDA_TRY(
      copy(levels.corners.data(), levels.corners.size(), b.level_corners, device.level_corners),
      kUpload);
  THRONG_CUDA_TRY(copy(level_at.data(), level_at.size(), b.level_at, device.level_at), kUpload);
  THRONG_CUDA_TRY(copy(uv.data(), uv.size(), b.uv, device.uv), kUpload);
  THRONG_CUDA_TRY(copy(tones.data(), tones.size(), b.tones, device.tones), kUpload);
  THRONG_CUDA_TRY(copy(bands.data(), bands.size(), b.band, device.band), kUpload);
  THRONG_CUDA_TRY(
      copy(corner_tones.data(), corner_tones.size(), b.corner_tones, device.corner_tones), kUpload);
  THRONG_CUDA_TRY(
      copy(relief_members.data(), relief_members.size(), b.relief_member, device.relief_member),
      kUpload);
  THRONG_CUDA_TRY(
      copy(reliefs->boxes.data(), reliefs->boxes.size(), b.relief_box, device.relief_box), kUpload);
  THRONG_CUDA_TRY(
      copy(reliefs->shape.data(), reliefs->shape.size(), b.relief_shape, device.relief_shape),
      kUpload);
  THRONG_CUDA_TRY(
      copy(reliefs->base.data(), reliefs->base.size(), b.relief_base, device.relief_base), kUpload);
  THRONG_CUDA_TRY(copy(reliefs->regions.data(), reliefs->regions.size(), b.relief_regions,
                       device.relief_regions),
                  kUpload);
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), kUpload);  // the vectors end here
  device_cast_ = device;
  cast_ = std::move(cast);
  return absl::OkStatus();
}

absl::Status CudaRasterizer::check(const FrameGeometry& geometry, const Viewport& viewport) const {
  if (viewport.width_px < 1 || viewport.width_px > kMaxSidePx || viewport.height_px < 1 ||
      viewport.height_px > kMaxSidePx) {
    return absl::InvalidArgumentError(absl::StrCat(kDraw, ": viewport is ", viewport.width_px, "x",
                                                   viewport.height_px,
                                                   " px, each side must be 1 to ", kMaxSidePx));
  }
  if (cast_ == nullptr) {
    return absl::FailedPreconditionError(absl::StrCat(kDraw, ": no cast is uploaded"));
  }
  if (geometry.splats.size() > kMostSplats) {
    return absl::ResourceExhaustedError(
        absl::StrCat(kDraw, ": ", geometry.splats.size(), " splats, at most ", kMostSplats));
  }
  for (const SpeckRun& run : geometry.speck_runs) {
    if (geometry.speck_table == nullptr ||
        std::uint64_t{run.first} + run.count > geometry.specks.size()) {
      return absl::InvalidArgumentError(absl::StrCat(kDraw, ": specks ", run.first, " + ",
                                                     run.count, ", must end by ",
                                                     geometry.specks.size(), " and have a table"));
    }
  }
  for (const Speck& shadow : geometry.shadows) {
    if (shadow.image != 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(kDraw, ": a shadow has image ", shadow.image, ", must be 0"));
    }
  }
  if (geometry.on_device != nullptr) return absl::OkStatus();
  const std::size_t count = geometry.instances.size();
  if (count == 0) return absl::OkStatus();
  if (!geometry.shared.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(kDraw, ": takes batched geometry only where it comes from the processor"));
  }
  if (!geometry.representation.empty() &&
      (geometry.representation.size() != count || geometry.jointed.size() != count)) {
    return absl::InvalidArgumentError(absl::StrCat(kDraw, ": ", geometry.representation.size(),
                                                   " representations and ", geometry.jointed.size(),
                                                   " jointed instances, must be ", count));
  }
  if (geometry.vertex_offset.size() != count + 1 || geometry.triangle_offset.size() != count + 1 ||
      geometry.vertex_offset.back() != geometry.vertices.size() ||
      std::size_t{3} * geometry.triangle_offset.back() != geometry.indices.size()) {
    return absl::InvalidArgumentError(absl::StrCat(
        kDraw, ": ", count, " instances need offsets of ", count + 1, " that end at ",
        geometry.vertices.size(), " vertices and ", geometry.indices.size() / 3, " triangles"));
  }
  for (const VisibleInstance& instance : geometry.instances) {
    if (instance.character >= cast_->members.size()) {
      return absl::InvalidArgumentError(absl::StrCat(kDraw, ": character is ", instance.character,
                                                     ", the cast has ", cast_->members.size()));
    }
    const auto i = static_cast<std::size_t>(&instance - geometry.instances.data());
    const std::size_t joints = cast_->members[instance.character].character.joint_count();
    if (!geometry.representation.empty() &&
        geometry.representation[i] == Representation::kImpostor &&
        std::size_t{16} * (geometry.jointed[i].first_joint + joints) > geometry.joints.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat(kDraw, ": instance ", i, " has joints ", geometry.jointed[i].first_joint,
                       " + ", joints, ", must end by ", geometry.joints.size() / 16));
    }
  }
  return absl::OkStatus();
}

/// Those that the host has, then those that were made on the device.
absl::Status CudaRasterizer::take_splats(std::span<const Splat> splats, RasterJob& job) {
  if (splats.empty()) return absl::OkStatus();
  const Splat* own = job.splats;
  const std::size_t count = splats.size() + job.splat_count;
  if (count > kMostSplats) {
    return absl::ResourceExhaustedError(
        absl::StrCat(kDraw, ": ", count, " splats, at most ", kMostSplats));
  }
  DeviceBuffer<Splat>& all = buffers_->splats;
  THRONG_CUDA_TRY(all.resize(count), kDraw);
  THRONG_CUDA_TRY(cudaMemcpyAsync(all.data(), splats.data(), splats.size_bytes(),
                                  cudaMemcpyHostToDevice, stream_),
                  kDraw);
  if (job.splat_count > 0) {
    THRONG_CUDA_TRY(
        cudaMemcpyAsync(all.data() + splats.size(), own, job.splat_count * sizeof(Splat),
                        cudaMemcpyDeviceToDevice, stream_),
        kDraw);
  }
  job.splats = all.data();
  job.splat_count = static_cast<std::uint32_t>(count);
  return absl::OkStatus();
}

/// Specks from the host; their table is copied when it is another cast's.
absl::Status CudaRasterizer::take_specks(const FrameGeometry& geometry, RasterJob& job) {
  std::size_t count = 0;
  for (const SpeckRun& run : geometry.speck_runs) count += run.count;
  if (count == 0) return absl::OkStatus();
  Buffers& b = *buffers_;
  const SpeckTable& table = *geometry.speck_table;
  if (speck_cast_ == nullptr || speck_cast_ != table.cast) {
    speck_cast_.reset();  // half of another cast's pictures are of none
    THRONG_CUDA_TRY(copy(table.image.data(), table.image.size(), b.speck_image, job.speck_image),
                    kDraw);
    THRONG_CUDA_TRY(copy(table.slab.data(), table.slab.size(), b.speck_slab, job.speck_slab),
                    kDraw);
    THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), kDraw);  // the table may go
    speck_cast_ = table.cast;
  }
  job.speck_image = b.speck_image.data();
  job.speck_slab = b.speck_slab.data();
  THRONG_CUDA_TRY(b.specks.resize(count), kDraw);
  Speck* to = b.specks.data();
  for (const SpeckRun& run : geometry.speck_runs) {
    THRONG_CUDA_TRY(cudaMemcpyAsync(to, geometry.specks.data() + run.first,
                                    run.count * sizeof(Speck), cudaMemcpyHostToDevice, stream_),
                    kDraw);
    to += run.count;
  }
  job.specks = b.specks.data();
  job.speck_count = static_cast<std::uint32_t>(count);
  job.speck_detail = geometry.speck_detail;
  return absl::OkStatus();
}

/// Shadows of who is drawn by splats of nobody, behind the specks: the host's, then the device's.
absl::Status CudaRasterizer::take_shadows(const FrameGeometry& geometry, RasterJob& job) {
  job.first_shadow = job.speck_count;
  if (!job.scene.shadows) return absl::OkStatus();
  const auto* frame = dynamic_cast<const DeviceFrame*>(geometry.on_device);
  const std::size_t here = geometry.shadows.size();
  const std::size_t there = frame == nullptr ? 0 : frame->shadow_count;
  if (here + there == 0) return absl::OkStatus();
  const std::size_t count = job.speck_count + here + there;
  if (count >= RasterJob::kOnlyShadow) {
    return absl::ResourceExhaustedError(absl::StrCat(kDraw, ": ", count, " specks and shadows"));
  }
  DeviceBuffer<Speck>& all = buffers_->specks_and_shadows;
  THRONG_CUDA_TRY(all.resize(count), kDraw);
  Speck* to = all.data();
  const auto add = [&](const Speck* from, std::size_t more, cudaMemcpyKind kind) {
    Speck* at = std::exchange(to, to + more);
    return more == 0 ? cudaSuccess : cudaMemcpyAsync(at, from, more * sizeof(Speck), kind, stream_);
  };
  THRONG_CUDA_TRY(add(job.specks, job.speck_count, cudaMemcpyDeviceToDevice), kDraw);
  // pageable: the copy is taken before the call returns
  THRONG_CUDA_TRY(add(geometry.shadows.data(), here, cudaMemcpyHostToDevice), kDraw);
  if (there > 0) THRONG_CUDA_TRY(add(frame->shadows, there, cudaMemcpyDeviceToDevice), kDraw);
  job.specks = all.data();
  job.speck_count = static_cast<std::uint32_t>(count);
  return absl::OkStatus();
}

/// Where specks are on the picture. The host waits for the one number that says how much room the
/// tiles' lists need.
absl::Status CudaRasterizer::place_specks(RasterJob& job) {
  if (job.speck_count == 0) return absl::OkStatus();
  Buffers& b = *buffers_;
  const auto tiles = [](std::uint32_t px) {
    return (px + element::kSpeckTilePx - 1) / element::kSpeckTilePx;
  };
  job.speck_tiles_x = tiles(job.width_px);
  job.speck_tiles = job.speck_tiles_x * tiles(job.height_px);
  THRONG_CUDA_TRY(give(b.placed_specks, job.speck_count, job.placed_specks), kDraw);
  THRONG_CUDA_TRY(give(b.first_entry, std::size_t{job.speck_count} + 1, job.first_entry), kDraw);
  THRONG_CUDA_TRY(give(b.first_of_tile, std::size_t{job.speck_tiles} + 1, job.first_of_tile),
                  kDraw);
  THRONG_CUDA_TRY(give(b.nearest, job.speck_tiles, job.nearest), kDraw);
  THRONG_CUDA_TRY(give(b.farthest, job.speck_tiles, job.farthest), kDraw);
  std::size_t scratch_bytes = 0;
  THRONG_CUDA_TRY(render::cuda::scan_scratch_bytes(std::max(job.speck_count, job.speck_tiles) + 1,
                                                   scratch_bytes),
                  kDraw);
  THRONG_CUDA_TRY(b.scratch.resize(scratch_bytes), kDraw);
  THRONG_CUDA_TRY(b.read_entries.resize(sizeof(std::uint32_t)), kDraw);
  THRONG_CUDA_TRY(launch_place_specks(job, b.scratch.data(), b.scratch.size_bytes(), stream_),
                  kDraw);
  THRONG_CUDA_TRY(cudaMemcpyAsync(b.read_entries.data(), job.first_entry + job.speck_count,
                                  sizeof(std::uint32_t), cudaMemcpyDeviceToHost, stream_),
                  kDraw);
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), kDraw);
  std::memcpy(&job.speck_entries, b.read_entries.data(), sizeof job.speck_entries);
  if (job.speck_entries == 0) return absl::OkStatus();
  for (int k = 0; k < 2; ++k) {
    THRONG_CUDA_TRY(give(b.speck_key[k], job.speck_entries, job.speck_key[k]), kDraw);
    THRONG_CUDA_TRY(give(b.speck_number[k], job.speck_entries, job.speck_number[k]), kDraw);
  }
  THRONG_CUDA_TRY(speck_scratch_bytes(job.speck_entries, scratch_bytes), kDraw);
  THRONG_CUDA_TRY(b.scratch.resize(scratch_bytes), kDraw);
  const std::size_t pixels = std::size_t{job.width_px} * job.height_px;
  const std::size_t words = std::size_t{16} * job.word_blocks_x * ((2 * job.height_px + 3) / 4);
  THRONG_CUDA_TRY(give(b.speck_light, pixels, job.speck_light), kDraw);
  THRONG_CUDA_TRY(give(b.speck_through, words, job.speck_through), kDraw);
  return absl::OkStatus();
}

absl::Status CudaRasterizer::take_geometry(const FrameGeometry& geometry, RasterJob& job) {
  if (geometry.on_device != nullptr) {
    const auto* frame = dynamic_cast<const DeviceFrame*>(geometry.on_device);
    if (frame == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat(kDraw, ": the geometry is of another backend"));
    }
    THRONG_CUDA_TRY(cudaEventRecord(ready_, frame->stream), kDraw);
    THRONG_CUDA_TRY(cudaStreamWaitEvent(stream_, ready_, 0), kDraw);
    job.count = frame->instance_count;
    job.vertices_total = static_cast<std::uint32_t>(frame->vertex_count);
    job.triangles_total = static_cast<std::uint32_t>(frame->triangle_count);
    job.triangles_drawn = frame->triangles_drawn;
    job.shared = frame->shared;
    job.posed = frame->posed;
    job.instance = frame->instances;
    job.vertex_offset = frame->vertex_offset;
    job.triangle_offset = frame->triangle_offset;
    job.vertices = frame->vertices;
    job.indices = frame->indices;
    job.representation = frame->representation;
    job.jointed = frame->jointed;
    job.joints = frame->joints;
    job.splats = frame->splats;
    job.splat_count = frame->splat_count;
    job.specks = frame->specks;
    job.speck_count = frame->speck_count;
    job.speck_detail = frame->speck_detail;
    job.speck_image = frame->speck_image;
    job.speck_slab = frame->speck_slab;
    return absl::OkStatus();
  }
  if (absl::Status status = take_specks(geometry, job); !status.ok()) return status;
  Buffers& b = *buffers_;
  const std::size_t count = geometry.instances.size();
  if (count == 0) return absl::OkStatus();
  THRONG_CUDA_TRY(copy(geometry.instances.data(), count, b.instance, job.instance), kDraw);
  THRONG_CUDA_TRY(
      copy(geometry.vertex_offset.data(), count + 1, b.vertex_offset, job.vertex_offset), kDraw);
  THRONG_CUDA_TRY(
      copy(geometry.triangle_offset.data(), count + 1, b.triangle_offset, job.triangle_offset),
      kDraw);
  THRONG_CUDA_TRY(
      copy(geometry.vertices.data(), geometry.vertices.size(), b.vertices, job.vertices), kDraw);
  THRONG_CUDA_TRY(copy(geometry.indices.data(), geometry.indices.size(), b.indices, job.indices),
                  kDraw);
  if (!geometry.representation.empty()) {
    THRONG_CUDA_TRY(
        copy(geometry.representation.data(), count, b.representation, job.representation), kDraw);
    THRONG_CUDA_TRY(copy(geometry.jointed.data(), count, b.jointed, job.jointed), kDraw);
    THRONG_CUDA_TRY(copy(geometry.joints.data(), geometry.joints.size(), b.joints, job.joints),
                    kDraw);
  }
  job.count = static_cast<std::uint32_t>(count);
  job.vertices_total = static_cast<std::uint32_t>(geometry.vertices.size());
  job.triangles_total = geometry.triangle_offset.back();
  for (const VisibleInstance& instance : geometry.instances) {
    job.triangles_drawn += instance.triangle_count;
  }
  return absl::OkStatus();
}

absl::Status CudaRasterizer::make_room(RasterJob& job, std::uint32_t most_blocks) {
  Buffers& b = *buffers_;
  const std::size_t pixels = std::size_t{job.width_px} * job.height_px;
  const std::size_t words = std::size_t{16} * job.word_blocks_x * ((2 * job.height_px + 3) / 4);
  THRONG_CUDA_TRY(give(b.counts, 1, job.counts), kDraw);
  if (facts_ != nullptr) {
    THRONG_CUDA_TRY(give(b.fact_depth, pixels, job.fact_depth), kDraw);
    THRONG_CUDA_TRY(give(b.fact_instance, pixels, job.fact_instance), kDraw);
    THRONG_CUDA_TRY(give(b.fact_bounds, job.count, job.fact_bounds), kDraw);
  }
  if (!has_words(job)) return absl::OkStatus();
  THRONG_CUDA_TRY(give(b.words, words, job.words), kDraw);
  if (job.count == 0) return absl::OkStatus();
  std::size_t scratch_bytes = 0;
  THRONG_CUDA_TRY(render::cuda::scan_scratch_bytes(job.count + 1, scratch_bytes), kDraw);
  THRONG_CUDA_TRY(b.scratch.resize(scratch_bytes), kDraw);
  THRONG_CUDA_TRY(give(b.shade, job.count, job.shade), kDraw);
  THRONG_CUDA_TRY(give(b.block_count, job.count + 1, job.block_count), kDraw);
  THRONG_CUDA_TRY(give(b.first_block, job.count + 1, job.first_block), kDraw);
  THRONG_CUDA_TRY(give(b.block_instance, most_blocks, job.block_instance), kDraw);
  if (job.shared != nullptr) {
    THRONG_CUDA_TRY(give(b.own_blocks, most_blocks, job.own_blocks), kDraw);
    THRONG_CUDA_TRY(give(b.small_units, job.count, job.small_units), kDraw);
    THRONG_CUDA_TRY(give(b.large_units, job.count, job.large_units), kDraw);
  }
  THRONG_CUDA_TRY(give(b.projected, job.vertices_total, job.projected), kDraw);
  THRONG_CUDA_TRY(give(b.special, job.triangles_total, job.special), kDraw);
  THRONG_CUDA_TRY(give(b.large, kLargeRoom, job.large), kDraw);
  THRONG_CUDA_TRY(give(b.tiles, kTileRoom, job.tiles), kDraw);
  if (!job.scene.shadows) return absl::OkStatus();
  THRONG_CUDA_TRY(give(b.candidates, job.count, job.candidates), kDraw);
  THRONG_CUDA_TRY(give(b.casters, job.count, job.casters), kDraw);
  THRONG_CUDA_TRY(give(b.blobs, job.count, job.blobs), kDraw);
  THRONG_CUDA_TRY(give(b.blob_tiles, kTileRoom, job.blob_tiles), kDraw);
  THRONG_CUDA_TRY(give(b.shadow, words, job.shadow), kDraw);
  THRONG_CUDA_TRY(give(b.blob_shadow, pixels, job.blob_shadow), kDraw);
  if (job.cast.first_surrounding >= cast_->members.size()) return absl::OkStatus();
  THRONG_CUDA_TRY(give(b.figure_first, element::FigureCells::kCount, job.figures.first), kDraw);
  THRONG_CUDA_TRY(give(b.figure_next, job.count, job.figures.next), kDraw);
  return absl::OkStatus();
}

absl::Status CudaRasterizer::run(const RasterJob& job, std::uint32_t most_blocks,
                                 cudaStream_t stream, bool recorded) {
  Buffers& b = *buffers_;
  const std::size_t pixels = std::size_t{job.width_px} * job.height_px;
  const std::size_t words = std::size_t{16} * job.word_blocks_x * ((2 * job.height_px + 3) / 4);
  THRONG_CUDA_TRY(moments_.record(kBegun, stream, recorded), kDraw);
  THRONG_CUDA_TRY(cudaMemsetAsync(job.counts, 0, sizeof(RasterCounts), stream), kDraw);
  if (has_words(job)) {
    THRONG_CUDA_TRY(cudaMemsetAsync(job.words, 0, words * sizeof(Word), stream), kDraw);
  }
  if (job.count > 0) {
    if (job.scene.shadows) {
      THRONG_CUDA_TRY(cudaMemsetAsync(job.shadow, 0, words * sizeof(std::uint32_t), stream), kDraw);
      THRONG_CUDA_TRY(cudaMemsetAsync(job.blob_shadow, 0, pixels * sizeof(std::uint32_t), stream),
                      kDraw);
    }
    if (job.figures.first != nullptr) {
      THRONG_CUDA_TRY(cudaMemsetAsync(job.figures.first, 0xff,
                                      element::FigureCells::kCount * sizeof(std::uint32_t), stream),
                      kDraw);
    }
    THRONG_CUDA_TRY(launch_prepare(job, stream), kDraw);
    THRONG_CUDA_TRY(render::cuda::launch_scan(job.block_count, job.first_block, job.count + 1,
                                              b.scratch.data(), b.scratch.size_bytes(), stream),
                    kDraw);
    THRONG_CUDA_TRY(launch_shadows(job, stream), kDraw);
  }
  THRONG_CUDA_TRY(moments_.record(kShadowsEnd, stream, recorded), kDraw);
  if (job.count > 0) {
    THRONG_CUDA_TRY(launch_raster(job, most_blocks, stream), kDraw);
    THRONG_CUDA_TRY(launch_shared(job, stream), kDraw);
  }
  THRONG_CUDA_TRY(launch_forms(job, stream), kDraw);
  if (job.count > 0) {
    THRONG_CUDA_TRY(launch_large(job, stream), kDraw);
  }
  THRONG_CUDA_TRY(moments_.record(kTrianglesEnd, stream, recorded), kDraw);
  THRONG_CUDA_TRY(launch_specks(job, b.scratch.data(), b.scratch.size_bytes(), stream), kDraw);
  THRONG_CUDA_TRY(launch_resolve(job, stream), kDraw);
  THRONG_CUDA_TRY(moments_.record(kResolveEnds, stream, recorded), kDraw);
  THRONG_CUDA_TRY(launch_facts(job, stream), kDraw);
  return absl::OkStatus();
}

/// Room for a picture that nobody looks at any more.
absl::StatusOr<std::shared_ptr<CudaPicture>> CudaRasterizer::free_picture() {
  for (const std::shared_ptr<CudaPicture>& picture : pictures_) {
    if (picture.use_count() != 1) continue;
    std::atomic_thread_fence(std::memory_order_acquire);  // what its last user did is done
    return picture;
  }
  auto picture = CudaPicture::make(device_);
  if (picture.ok()) pictures_.push_back(*picture);
  return picture;
}

absl::Status CudaRasterizer::read_facts(const RasterJob& job) {
  const std::size_t pixels = std::size_t{job.width_px} * job.height_px;
  static_assert(sizeof(FactBox) == sizeof(PixelBox));
  facts_->depth.resize(pixels);
  facts_->instance.resize(pixels);
  facts_->bounds.resize(job.count);
  const auto fetch = [&](auto& to, const void* from) {
    return to.empty() ? cudaSuccess
                      : cudaMemcpyAsync(to.data(), from, to.size() * sizeof(to[0]),
                                        cudaMemcpyDeviceToHost, stream_);
  };
  THRONG_CUDA_TRY(fetch(facts_->depth, job.fact_depth), kDraw);
  THRONG_CUDA_TRY(fetch(facts_->instance, job.fact_instance), kDraw);
  THRONG_CUDA_TRY(fetch(facts_->bounds, job.fact_bounds), kDraw);
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), kDraw);
  return absl::OkStatus();
}

/// What the last frame that is done counted.
void CudaRasterizer::take_counts() {
  if (!counts_pending_ || cudaEventQuery(ended_) != cudaSuccess) {
    cudaGetLastError();  // not yet is no error
    return;
  }
  counts_pending_ = false;
  RasterCounts counts;
  std::memcpy(&counts, buffers_->read_back.data(), sizeof counts);
  counters_.surviving = counts.surviving;
  float device_ms = 0.0F;
  if (cudaEventElapsedTime(&device_ms, began_, ended_) == cudaSuccess) {
    counters_.device_ms = static_cast<double>(device_ms);
    counters_.device_shadows_ms = moments_.ms(kBegun, kShadowsEnd);
    counters_.device_triangles_ms = moments_.ms(kShadowsEnd, kTrianglesEnd);
    counters_.device_resolve_ms = moments_.ms(kTrianglesEnd, kResolveEnds);
  }
}

absl::Status CudaRasterizer::draw(const FrameGeometry& geometry, const Camera& camera,
                                  const Viewport& viewport, const glm::dvec3& origin_world,
                                  const Look& look, Picture& picture) {
  if (absl::Status status = check(geometry, viewport); !status.ok()) return status;
  THRONG_CUDA_TRY(cudaSetDevice(device_), kDraw);
  RasterJob job;
  job.cast = device_cast_;
  job.scene = make_scene_frame(camera, viewport, origin_world, look);
  job.channel = {look.channel_low, look.channel_high, look.color_by_channel, look.color_map};
  job.width_px = viewport.width_px;
  job.height_px = viewport.height_px;
  job.grid = {clip_from_relative(camera, viewport),
              static_cast<std::int32_t>(2 * viewport.width_px),
              static_cast<std::int32_t>(2 * viewport.height_px)};
  job.word_blocks_x = (2 * viewport.width_px + 3) / 4;
  job.relief_view = make_relief_view(job.scene, job.grid);
  job.relief_search = look.relief_search;
  job.relief_search.linear_steps = std::clamp(job.relief_search.linear_steps, 1U, 1024U);
  job.relief_search.binary_steps = std::min(job.relief_search.binary_steps, 32U);
  job.view_from_relative = glm::mat3(view_from_relative(camera));
  job.camera_up = glm::transpose(job.view_from_relative)[1];
  if (absl::Status status = take_geometry(geometry, job); !status.ok()) return status;
  // the view's next frame waits for what looks at this one, also where something fails half-way
  const auto* frame = dynamic_cast<const DeviceFrame*>(geometry.on_device);
  absl::Cleanup leave_frame = [this, frame] {
    if (frame != nullptr) cudaEventRecord(frame->drawn, stream_);
  };
  if (absl::Status status = take_splats(geometry.splats, job); !status.ok()) return status;
  if (absl::Status status = take_shadows(geometry, job); !status.ok()) return status;
  if (absl::Status status = place_specks(job); !status.ok()) return status;
  // of batched geometry made by hand, instances may not say what is theirs
  const std::uint64_t triangles = std::max<std::uint64_t>(job.triangles_drawn, job.triangles_total);
  const std::uint64_t most_blocks =
      triangles / element::kBlockTriangles +
      (job.representation == nullptr ? 1U : 2U) * std::uint64_t{job.count};
  if (most_blocks > element::kMaxBlocks) {
    return absl::ResourceExhaustedError(absl::StrCat(
        kDraw, ": up to ", most_blocks, " triangle blocks, at most ", element::kMaxBlocks));
  }
  take_counts();
  auto kept = free_picture();
  if (!kept.ok()) return kept.status();
  THRONG_CUDA_TRY((*kept)->resize(viewport.width_px, viewport.height_px), kDraw);
  job.pixels = (*kept)->pixels();
  Buffers& b = *buffers_;
  THRONG_CUDA_TRY(b.read_back.resize(sizeof(RasterCounts)), kDraw);
  if (absl::Status status = make_room(job, static_cast<std::uint32_t>(most_blocks)); !status.ok()) {
    return status;
  }
  THRONG_CUDA_TRY(cudaEventRecord(began_, stream_), kDraw);
  THRONG_CUDA_TRY(moments_.make(), kDraw);
  const auto launches = [&](cudaStream_t stream, bool recorded) {
    return run(job, static_cast<std::uint32_t>(most_blocks), stream, recorded);
  };
  if (absl::Status status = graph_.run(stream_, kDraw, launches); !status.ok()) return status;
  THRONG_CUDA_TRY(cudaEventRecord((*kept)->drawn(), stream_), kDraw);
  // the picture and the counts are all that is read back
  THRONG_CUDA_TRY(cudaMemcpyAsync(b.read_back.data(), job.counts, sizeof(RasterCounts),
                                  cudaMemcpyDeviceToHost, stream_),
                  kDraw);
  THRONG_CUDA_TRY(cudaEventRecord(ended_, stream_), kDraw);
  // last of all: the stages of the next frame wait for it, so that they find this one's times
  std::move(leave_frame).Cancel();
  if (frame != nullptr) THRONG_CUDA_TRY(cudaEventRecord(frame->drawn, stream_), kDraw);
  counts_pending_ = true;
  counters_.drawn = job.count;
  counters_.triangles = job.triangles_drawn;
  counters_.size_bytes = b.size_bytes();
  for (const auto& one : pictures_) counters_.size_bytes += one->size_bytes();
  picture.width_px = viewport.width_px;
  picture.height_px = viewport.height_px;
  if (facts_ != nullptr) {
    if (absl::Status status = read_facts(job); !status.ok()) return status;
  }
  if (picture.may_stay) {
    picture.rgbx.clear();
    picture.on_device = *std::move(kept);
    return absl::OkStatus();
  }
  if (absl::Status status = (*kept)->fetch(picture.rgbx); !status.ok()) return status;
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), kDraw);
  take_counts();
  return absl::OkStatus();
}

}  // namespace
}  // namespace cuda

absl::StatusOr<std::unique_ptr<Rasterizer>> make_cuda_rasterizer() {
  return cuda::CudaRasterizer::make();
}

}  // namespace throng::render::visibility
