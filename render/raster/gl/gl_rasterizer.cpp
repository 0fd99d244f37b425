#include "render/raster/gl/gl_rasterizer.hpp"

#include <absl/strings/str_cat.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>
#include <span>
#include <vector>

#include "render/compute/cpu/levels.hpp"
#include "render/compute/cpu/work_pool.hpp"
#include "render/raster/element/figure_shadow.hpp"
#include "render/raster/element/tone.hpp"
#include "render/raster/gl/cast_textures.hpp"
#include "render/raster/gl/cuda_interop.hpp"
#include "render/raster/gl/egl_context.hpp"
#include "render/raster/gl/mapped_buffer.hpp"
#include "render/raster/gl/program.hpp"
#include "render/raster/gl/read_back.hpp"
#include "render/raster/gl/relief_pass.hpp"
#include "render/raster/gl/shaders.hpp"
#include "render/raster/gl/splat_pass.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/smooth_edges.hpp"

namespace throng::render::gl {
namespace {

constexpr std::uint32_t kMaxSidePx = 16384;
// A picture beyond either is drawn in tiles: four samples of 16384x16384 would be 8 GiB.
constexpr std::uint32_t kTargetMaxSidePx = 8192;
constexpr std::uint64_t kTargetMaxPixels = 4096ull * 2304;
constexpr std::uint32_t kTilePx = 2048;

// Mirrors `Frame` in shaders.cpp (std140).
struct FrameUniforms {
  glm::mat4 clip_from_relative;
  glm::vec4 sun_direction, sun_color, sky_color, ground_light, horizon_color, ground_color;
  glm::vec4 ray_origin, ray_origin_x, ray_origin_y, ray_direction, ray_direction_x, ray_direction_y;
  glm::vec4 grid;
};

absl::Status gl_failed(const char* call) {
  const GLenum code = glGetError();
  if (code == GL_NO_ERROR) return absl::OkStatus();
  const std::string message = absl::StrCat("gl draw: ", call, ": GL error 0x", absl::Hex(code));
  while (glGetError() != GL_NO_ERROR) {
  }
  if (code == GL_OUT_OF_MEMORY) return absl::ResourceExhaustedError(message);
  return absl::InternalError(message);
}

/// What is drawn to (one or four samples a pixel), and the picture that is read back.
struct Target {
  std::uint32_t width_px = 0, height_px = 0;
  GLuint samples = 0, depth = 0,
         picture = 0;  // renderbuffers; no samples where one a pixel is drawn
  GLuint draw_fbo = 0, read_fbo = 0;
  std::uint64_t last_use = 0;

  void release() {
    const GLuint buffers[] = {samples, depth, picture};
    const GLuint fbos[] = {draw_fbo, read_fbo};
    glDeleteRenderbuffers(3, buffers);
    glDeleteFramebuffers(2, fbos);
    *this = Target{};
  }
};

/// Whether what `upload` makes of one cast holds for another: the same characters, and surroundings
/// with the same texture.
bool shares_textures(const Cast& cast, const Cast& before) {
  const std::size_t kept = kept_members(cast, before);
  if (kept == 0 || kept == cast.members.size() || kept == before.members.size()) return false;
  const Character &now = cast.members[kept].character, &then = before.members[kept].character;
  return std::ranges::equal(now.base_color.texels, then.base_color.texels) &&
         now.base_color.width_px == then.base_color.width_px && !now.triangle_flags.empty() &&
         !then.triangle_flags.empty() && now.triangle_flags[0] == then.triangle_flags[0];
}

class GlRasterizer final : public Rasterizer {
 public:
  GlRasterizer(std::unique_ptr<EglContext> context, unsigned threads)
      : context_(std::move(context)), pool_(threads) {}

  ~GlRasterizer() override {
    BoundContext bound(*context_);
    if (!bound.status().ok()) return;
    last_.reset();
    read_back_.release();
    for (Target& target : targets_) target.release();
    interop_.reset();
    vertices_.release();
    indices_.release();
    instances_.release();
    tones_.release();
    tone_shifts_.release();
    reliefs_.release();
    splats_.release();
    figures_.release();
    const GLuint textures[] = {base_color_, tint_mask_};
    glDeleteTextures(2, textures);
    glDeleteBuffers(1, &uniforms_);
    glDeleteVertexArrays(1, &mesh_array_);
    glDeleteVertexArrays(1, &empty_array_);
    for (GLuint program : {agents_, blobs_, cast_shadows_, floors_, background_})
      glDeleteProgram(program);
  }

  /// Takes vertices from the memory of a CUDA device, if OpenGL draws on it.
  void share_with([[maybe_unused]] int device) {
#if THRONG_WITH_CUDA
    BoundContext bound(*context_);
    if (!bound.status().ok()) return;
    auto interop = make_cuda_interop(device);
    interop_note_ = interop.ok() ? "; vertices from CUDA without the host"
                                 : absl::StrCat("; ", interop.status().message());
    if (interop.ok()) interop_ = *std::move(interop);
#endif
  }

  bool takes_device() const override { return interop_ != nullptr; }

  absl::Status prepare() {
    BoundContext bound(*context_);
    if (!bound.status().ok()) return bound.status();
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max_texture_px_);
    glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &max_layers_);
    glGetIntegerv(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &max_storage_bytes_);

    // Measured on llvmpipe, 1280x720, 2 cores: four samples take 2.5 to 4.5 times as long as one.
    samples_ = context_->software() ? 1 : 4;
    if (const char* set = std::getenv("THRONG_GL_SAMPLES"); set != nullptr) {
      if (std::string(set) != "1" && std::string(set) != "4") {
        return absl::InvalidArgumentError(
            absl::StrCat("THRONG_GL_SAMPLES is ", set, ", must be 1 or 4"));
      }
      samples_ = set[0] - '0';
    }

    struct Wanted {
      GLuint* program;
      const char* name;
      std::string vertex, fragment;
    };
    const Wanted wanted[] = {
        {&blobs_, "blobs", blob_vertex_shader(), blob_fragment_shader()},
        {&cast_shadows_, "cast shadows", cast_shadow_vertex_shader(),
         cast_shadow_fragment_shader()},
        {&floors_, "floors", background_vertex_shader(), floor_fragment_shader()},
        {&background_, "background", background_vertex_shader(), background_fragment_shader()}};
    for (const Wanted& one : wanted) {
      auto program = make_program(one.name, one.vertex, one.fragment);
      if (!program.ok()) return program.status();
      *one.program = *program;
    }
    if (auto status = compile_agents(ShaderOptions{}); !status.ok()) return status;
    if (auto status = reliefs_.prepare(); !status.ok()) return status;
    if (auto status = splats_.prepare(samples_); !status.ok()) return status;

    glCreateBuffers(1, &uniforms_);
    glNamedBufferStorage(uniforms_, sizeof(FrameUniforms), nullptr, GL_DYNAMIC_STORAGE_BIT);
    glCreateVertexArrays(1, &empty_array_);
    glCreateVertexArrays(1, &mesh_array_);
    for (GLuint attribute : {0u, 1u, 2u, 3u}) {
      glEnableVertexArrayAttrib(mesh_array_, attribute);
      glVertexArrayAttribBinding(mesh_array_, attribute, 0);
    }
    glVertexArrayAttribFormat(mesh_array_, 0, 3, GL_FLOAT, GL_FALSE,
                              offsetof(BatchVertex, position_relative));
    glVertexArrayAttribFormat(mesh_array_, 1, 2, GL_SHORT, GL_TRUE, offsetof(BatchVertex, normal));
    glVertexArrayAttribFormat(mesh_array_, 2, 2, GL_UNSIGNED_SHORT, GL_TRUE,
                              offsetof(BatchVertex, uv));
    glVertexArrayAttribIFormat(mesh_array_, 3, 1, GL_UNSIGNED_INT, offsetof(BatchVertex, visible));

    // One clip space on every backend, and rows from the top as everywhere outside GL.
    glClipControl(GL_UPPER_LEFT, GL_ZERO_TO_ONE);
    glEnable(GL_FRAMEBUFFER_SRGB);
    glEnable(GL_MULTISAMPLE);
    glDisable(GL_DITHER);
    glFrontFace(GL_CCW);
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    return gl_failed("prepare");
  }

  RasterInfo info() const override {
    return {absl::StrCat("gl (", context_->renderer(), ", ", context_->platform(), ")"),
            absl::StrCat(
                context_->vendor(), ", ", context_->renderer(), ", OpenGL ", context_->version(),
                interop_note_,
                context_->passed_by().empty() ? "" : "; not elsewhere: ", context_->passed_by())};
  }

  bool draws(Representation form) const override { return form <= Representation::kPoints; }

  absl::Status upload(std::shared_ptr<const Cast> cast) override {
    if (cast == nullptr || cast->members.empty()) {
      return absl::InvalidArgumentError("gl upload: the cast is empty");
    }
    // a layer for each character, and one for all surroundings
    const auto surroundings =
        std::find_if(cast->members.begin(), cast->members.end(),
                     [](const CastMember& member) { return member.environment; });
    const std::span<const CastMember> members(
        cast->members.data(), static_cast<std::size_t>(surroundings - cast->members.begin()) +
                                  (surroundings != cast->members.end() ? 1 : 0));
    if (members.size() > static_cast<std::size_t>(max_layers_)) {
      return absl::InvalidArgumentError(
          absl::StrCat("gl upload: ", members.size(), " characters, at most ", max_layers_));
    }
    if (cast_ != nullptr && shares_textures(*cast, *cast_)) {
      cast_ = std::move(cast);
      return absl::OkStatus();
    }
    BoundContext bound(*context_);
    if (!bound.status().ok()) return bound.status();
    if (absl::Status status = wait_for_last(); !status.ok()) return status;

    ShaderOptions options;
    std::vector<const MipImage*> base, masks;
    for (const CastMember& member : members) {
      for (const std::uint8_t flags : member.character.triangle_flags) {
        options.two_sided |= (flags & kTriangleDoubleSided) != 0;
        options.cutout |= (flags & kTriangleAlphaCutout) != 0;
      }
      options.tint_mask |= member.character.tint_mask.level_count > 0;
      options.tones |= !member.character.corner_tones.band.empty();
      options.surroundings |= member.environment;
      base.push_back(&member.character.base_color);
      masks.push_back(&member.character.tint_mask);
    }
    try {
      const auto limit_px = static_cast<std::uint32_t>(std::min(max_texture_px_, 4096));
      auto base_layers = make_texture_layers(base, true, 0xb4b4b4ffu, limit_px);
      if (!base_layers.ok()) return base_layers.status();
      auto mask_layers = make_texture_layers(masks, false, 0u, limit_px);
      if (!mask_layers.ok()) return mask_layers.status();
      upload_array(base_color_, *base_layers, GL_SRGB8_ALPHA8);
      upload_array(tint_mask_, *mask_layers, GL_RGBA8);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("gl upload: no memory for the cast's textures");
    }
    if (auto status = compile_agents(options); !status.ok()) return status;
    if (auto status = reliefs_.upload(*cast); !status.ok()) return status;
    if (auto status = upload_tones(*cast); !status.ok()) return status;
    cast_ = std::move(cast);
    return gl_failed("upload");
  }

  absl::Status draw(const FrameGeometry& geometry, const Camera& camera, const Viewport& viewport,
                    const glm::dvec3& origin_world, const Look& look, Picture& picture) override {
    BoundContext bound(*context_);
    if (!bound.status().ok()) return bound.status();
    if (absl::Status status = wait_for_last(); !status.ok()) return status;
    on_device_ = geometry.on_device != nullptr;
    if (!on_device_) {
      return draw_bound(geometry, camera, viewport, origin_world, look, picture);
    }
    if (interop_ == nullptr) {
      return absl::InvalidArgumentError("gl draw: the geometry is on a device");
    }
    auto staged = interop_->stage(*geometry.on_device);
    if (!staged.ok()) return staged.status();
    staged->splats = geometry.splats;
    return draw_bound(*staged, camera, viewport, origin_world, look, picture);
  }

 private:
  /// The frame before reads the buffers that are about to be filled.
  absl::Status wait_for_last() {
    const auto last = std::exchange(last_, nullptr);
    return last == nullptr ? absl::OkStatus() : last->wait();
  }

  absl::Status draw_bound(const FrameGeometry& geometry, const Camera& camera,
                          const Viewport& viewport, const glm::dvec3& origin_world,
                          const Look& look, Picture& picture) {
    if (viewport.width_px < 1 || viewport.width_px > kMaxSidePx || viewport.height_px < 1 ||
        viewport.height_px > kMaxSidePx) {
      return absl::InvalidArgumentError(absl::StrCat("gl draw: viewport is ", viewport.width_px,
                                                     "x", viewport.height_px,
                                                     " px, each side must be 1 to ", kMaxSidePx));
    }
    if (auto status = check(geometry); !status.ok()) return status;
    if (!geometry.indices.empty() && cast_ == nullptr) {
      return absl::FailedPreconditionError("gl draw: no cast is uploaded");
    }
    try {
      picture.width_px = viewport.width_px;
      picture.height_px = viewport.height_px;
      // software smooths edges once the pixels are there
      std::shared_ptr<GlPicture> kept;
      if (picture.may_stay && samples_ > 1) {
        auto taken = read_back_.take(context_, viewport.width_px, viewport.height_px);
        if (!taken.ok()) return taken.status();
        kept = *std::move(taken);
        picture.rgbx.clear();
      } else {
        picture.rgbx.resize(std::size_t{4} * viewport.width_px * viewport.height_px);
      }

      const SceneFrame scene = make_scene_frame(camera, viewport, origin_world, look);
      if (auto status = stage(geometry, scene, look); !status.ok()) return status;
      if (auto status = reliefs_.stage(geometry, scene.px_per_tangent, scene.orthographic);
          !status.ok()) {
        return status;
      }
      if (auto status = splats_.stage(geometry.splats); !status.ok()) return status;

      const bool whole = viewport.width_px <= kTargetMaxSidePx &&
                         viewport.height_px <= kTargetMaxSidePx &&
                         std::uint64_t{viewport.width_px} * viewport.height_px <= kTargetMaxPixels;
      const std::uint32_t tile_width = whole ? viewport.width_px : kTilePx;
      const std::uint32_t tile_height = whole ? viewport.height_px : kTilePx;
      for (std::uint32_t y = 0; y < viewport.height_px; y += tile_height) {
        for (std::uint32_t x = 0; x < viewport.width_px; x += tile_width) {
          const Tile tile{x, y, std::min(tile_width, viewport.width_px - x),
                          std::min(tile_height, viewport.height_px - y)};
          set_uniforms(tile, camera, viewport, scene);
          splats_.set_view(glm::mat3(view_from_relative(camera)), scene.px_per_tangent,
                           tile.width_px, tile.height_px, geometry.instances.size());
          if (auto status = draw_tile(geometry, tile, scene.shadows, look.relief_search, picture,
                                      kept == nullptr ? 0 : kept->buffer());
              !status.ok()) {
            return status;
          }
        }
      }
      if (kept != nullptr) {
        kept->close();
        last_ = kept;
        picture.on_device = std::move(kept);
        return absl::OkStatus();
      }
      if (samples_ == 1) smooth_edges(picture, smooth_scratch_, pool_);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError(absl::StrCat("gl draw: no memory for ", viewport.width_px,
                                                       "x", viewport.height_px, " px"));
    }
    return absl::OkStatus();
  }

  struct Tile {
    std::uint32_t x_px, y_px, width_px, height_px;
  };

  absl::Status compile_agents(const ShaderOptions& options) {
    auto program =
        make_program("agents", agent_vertex_shader(options), agent_fragment_shader(options));
    if (!program.ok()) return program.status();
    glDeleteProgram(agents_);
    agents_ = *program;
    options_ = options;
    return absl::OkStatus();
  }

  static void upload_array(GLuint& texture, const TextureLayers& layers, GLenum format) {
    glDeleteTextures(1, &texture);
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
    glTextureStorage3D(texture, static_cast<GLsizei>(layers.level_count), format,
                       static_cast<GLsizei>(layers.width_px),
                       static_cast<GLsizei>(layers.height_px),
                       static_cast<GLsizei>(layers.layer_count));
    for (std::uint32_t level = 0; level < layers.level_count; ++level) {
      glTextureSubImage3D(texture, static_cast<GLint>(level), 0, 0, 0,
                          static_cast<GLsizei>(std::max(1u, layers.width_px >> level)),
                          static_cast<GLsizei>(std::max(1u, layers.height_px >> level)),
                          static_cast<GLsizei>(layers.layer_count), GL_RGBA, GL_UNSIGNED_BYTE,
                          layers.levels[level].data());
    }
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  }

  absl::Status upload_tones(const Cast& cast) {
    std::vector<std::uint32_t> tones;
    first_tone_.clear();
    for (const CastMember& member : cast.members) {
      first_tone_.push_back(static_cast<std::uint32_t>(tones.size()));
      const std::span<const std::uint32_t> own = member.character.corner_tones.tone;
      tones.insert(tones.end(), own.begin(), own.end());
    }
    if (auto status = tones_.reserve(4 * tones.size()); !status.ok()) return status;
    if (!tones.empty()) std::memcpy(tones_.data(), tones.data(), 4 * tones.size());
    return absl::OkStatus();
  }

  /// Where each toned instance's tones are, as kTones wants it.
  absl::Status stage_tones(const FrameGeometry& geometry) {
    if (!options_.tones) return absl::OkStatus();
    const std::size_t count = geometry.instances.size();
    if (auto status = tone_shifts_.reserve(4 * count); !status.ok()) return status;
    std::vector<std::uint32_t>& shifts = shift_scratch_;
    shifts.assign(count, 0);
    for (std::size_t i = 0; i < count; ++i) {
      if ((shades_[i].character & kToned) == 0) continue;
      const VisibleInstance& instance = geometry.instances[i];
      const std::span<const ToneBand> bands =
          cast_->members[instance.character].character.corner_tones.band;
      shifts[i] = first_tone_[instance.character] - 3 * geometry.triangle_offset[i] +
                  element::first_tone(bands.data(), static_cast<std::uint32_t>(bands.size()),
                                      instance.vertex_count);
    }
    if (count > 0) std::memcpy(tone_shifts_.data(), shifts.data(), 4 * count);
    return absl::OkStatus();
  }

  absl::Status check(const FrameGeometry& geometry) const {
    const std::size_t count = geometry.instances.size();
    const auto wrong = [](const char* what, std::size_t value, std::size_t expected) {
      return absl::InvalidArgumentError(
          absl::StrCat("gl draw: ", what, " has ", value, " elements, must have ", expected));
    };
    if (!geometry.shared.empty()) {
      return absl::InvalidArgumentError("gl draw: the geometry is fused, must be batched");
    }
    if (geometry.indices.size() > 0x7fffffffu) {
      return absl::ResourceExhaustedError(
          absl::StrCat("gl draw: ", geometry.indices.size(), " indices, at most ", 0x7fffffffu));
    }
    if (geometry.indices.size() % 3 != 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("gl draw: ", geometry.indices.size(), " indices, must be a multiple of 3"));
    }
    if (count * sizeof(InstanceShade) > static_cast<std::size_t>(max_storage_bytes_)) {
      return absl::ResourceExhaustedError(
          absl::StrCat("gl draw: ", count, " visible instances, at most ",
                       static_cast<std::size_t>(max_storage_bytes_) / sizeof(InstanceShade)));
    }
    if (!geometry.indices.empty() || count > 0) {
      if (geometry.vertex_offset.size() != count + 1) {
        return wrong("vertex_offset", geometry.vertex_offset.size(), count + 1);
      }
      if (geometry.triangle_offset.size() != count + 1) {
        return wrong("triangle_offset", geometry.triangle_offset.size(), count + 1);
      }
      if (geometry.vertex_offset.back() != geometry.vertices.size()) {
        return wrong("vertices", geometry.vertices.size(), geometry.vertex_offset.back());
      }
      if (std::size_t{3} * geometry.triangle_offset.back() != geometry.indices.size()) {
        return wrong("indices", geometry.indices.size(),
                     std::size_t{3} * geometry.triangle_offset.back());
      }
    }
    if (cast_ != nullptr) {
      for (const VisibleInstance& instance : geometry.instances) {
        if (instance.character >= cast_->members.size()) {
          return absl::InvalidArgumentError(absl::StrCat("gl draw: character is ",
                                                         instance.character, ", the cast has ",
                                                         cast_->members.size()));
        }
      }
    }
    return absl::OkStatus();
  }

  /// Vertices and indices into buffers, from the host or from the device.
  absl::Status stage_vertices(const FrameGeometry& geometry) {
    if (on_device_) {
      drawn_vertices_ = interop_->vertices();
      drawn_indices_ = interop_->indices();
      return absl::OkStatus();
    }
    if (auto status = vertices_.reserve(geometry.vertices.size_bytes()); !status.ok()) {
      return status;
    }
    if (auto status = indices_.reserve(geometry.indices.size_bytes()); !status.ok()) return status;
    if (!geometry.indices.empty()) {
      std::memcpy(vertices_.data(), geometry.vertices.data(), geometry.vertices.size_bytes());
      std::memcpy(indices_.data(), geometry.indices.data(), geometry.indices.size_bytes());
    }
    drawn_vertices_ = vertices_.name();
    drawn_indices_ = indices_.name();
    return absl::OkStatus();
  }

  /// Copies the frame's arrays to the mapped buffers and plans the cast shadows.
  absl::Status stage(const FrameGeometry& geometry, const SceneFrame& scene, const Look& look) {
    if (auto status = instances_.reserve(geometry.instances.size() * sizeof(InstanceShade));
        !status.ok()) {
      return status;
    }
    if (auto status = stage_vertices(geometry); !status.ok()) return status;
    shades_.clear();
    casters_.clear();
    if (cast_ != nullptr) shade_instances(geometry, *cast_, scene, look, pool_, shades_, casters_);
    if (!shades_.empty()) {
      std::memcpy(instances_.data(), shades_.data(), shades_.size() * sizeof(InstanceShade));
    }

    if (auto status = stage_tones(geometry); !status.ok()) return status;
    if (auto status = stage_figures(geometry, scene); !status.ok()) return status;

    // Runs of neighbours in the batched buffer are one range of indices.
    caster_counts_.clear();
    caster_starts_.clear();
    std::uint32_t run_end = 0;
    for (const std::uint32_t caster : casters_) {
      const std::uint32_t begin = geometry.triangle_offset[caster];
      const std::uint32_t end = geometry.triangle_offset[caster + 1];
      if (begin == end) continue;
      if (!caster_counts_.empty() && begin == run_end) {
        caster_counts_.back() += static_cast<GLsizei>(3 * (end - begin));
      } else {
        caster_counts_.push_back(static_cast<GLsizei>(3 * (end - begin)));
        caster_starts_.push_back(
            reinterpret_cast<const void*>(std::uintptr_t{3} * begin * sizeof(GLuint)));
      }
      run_end = end;
    }
    return absl::OkStatus();
  }

  /// Who may throw a shadow on the surroundings that are seen.
  absl::Status stage_figures(const FrameGeometry& geometry, const SceneFrame& scene) {
    constexpr std::size_t kCells = element::FigureCells::kCount;
    shades_surroundings_ =
        scene.shadows && std::any_of(casters_.begin(), casters_.end(), [&](std::uint32_t i) {
          return shades_[i].cast_shadow == kNoBlob;
        });
    if (!options_.surroundings) return absl::OkStatus();
    if (auto status = figures_.reserve((kCells + shades_.size()) * sizeof(std::uint32_t));
        !status.ok()) {
      return status;
    }
    // lists are read as they are made, which mapped memory is slow at, so they are made aside
    figure_lists_.resize(kCells + shades_.size());
    listed_ = {figure_lists_.data(), figure_lists_.data() + kCells, -1e9F};
    std::fill_n(listed_.first, kCells, element::FigureCells::kNobody);
    for (std::size_t i = 0; i < shades_.size() && shades_surroundings_; ++i) {
      if (shades_[i].cast_shadow == kNoBlob) continue;
      if (!geometry.representation.empty() && geometry.representation[i] == Representation::kNone) {
        continue;
      }
      element::list_figure(listed_, shades_[i], static_cast<std::uint32_t>(i));
    }
    const std::size_t values = shades_surroundings_ ? figure_lists_.size() : kCells;
    std::memcpy(figures_.data(), figure_lists_.data(), values * sizeof(std::uint32_t));
    return absl::OkStatus();
  }

  void bind_tones(const FrameGeometry& geometry) {
    const bool sees_all = std::max(geometry.vertices.size_bytes(), geometry.indices.size_bytes()) <=
                          static_cast<std::size_t>(max_storage_bytes_);
    glUniform1i(0, sees_all ? 1 : 0);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 7, sees_all ? drawn_vertices_ : 0);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 8, sees_all ? drawn_indices_ : 0);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 9, tones_.name());
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 10, tone_shifts_.name());
  }

  void set_uniforms(const Tile& tile, const Camera& camera, const Viewport& viewport,
                    const SceneFrame& scene) {
    FrameUniforms uniforms{};
    uniforms.clip_from_relative = clip_from_relative(camera, viewport);
    if (tile.width_px != viewport.width_px || tile.height_px != viewport.height_px) {
      // the tile's part of clip space, stretched to all of it
      const auto width = static_cast<double>(viewport.width_px);
      const auto height = static_cast<double>(viewport.height_px);
      glm::mat4 tile_from_clip(1.0F);
      tile_from_clip[0][0] = static_cast<float>(width / tile.width_px);
      tile_from_clip[1][1] = static_cast<float>(height / tile.height_px);
      tile_from_clip[3][0] =
          static_cast<float>((width - 2.0 * tile.x_px - tile.width_px) / tile.width_px);
      tile_from_clip[3][1] =
          static_cast<float>((2.0 * tile.y_px + tile.height_px - height) / tile.height_px);
      uniforms.clip_from_relative = tile_from_clip * uniforms.clip_from_relative;
    }
    const auto flag = [](bool value) { return value ? 1.0F : 0.0F; };
    uniforms.sun_direction = glm::vec4(scene.sun_direction, scene.ground_relative_m);
    uniforms.sun_color = glm::vec4(scene.sun_color, flag(scene.ground_relative_m < 0.0F));
    uniforms.sky_color = glm::vec4(scene.sky_color, flag(scene.ground));
    uniforms.ground_light = glm::vec4(scene.ground_light, flag(scene.shadows));
    uniforms.horizon_color = glm::vec4(scene.horizon_color, flag(scene.orthographic));
    uniforms.ground_color = glm::vec4(scene.ground_color, scene.haze_per_m);
    uniforms.ray_origin = glm::vec4(scene.ray_origin, flag(!shades_surroundings_));
    uniforms.ray_origin_x = glm::vec4(scene.ray_origin_x, 0.0F);
    uniforms.ray_origin_y = glm::vec4(scene.ray_origin_y, 0.0F);
    // a little above the highest floor
    const float lift_m = shades_surroundings_ ? 1.25F * element::kFloorM : 0.0F;
    uniforms.ray_direction = glm::vec4(scene.ray_direction, lift_m);
    uniforms.ray_direction_x = glm::vec4(scene.ray_direction_x, 0.0F);
    uniforms.ray_direction_y = glm::vec4(scene.ray_direction_y, 0.0F);
    uniforms.grid =
        glm::vec4(scene.grid_eye, static_cast<float>(tile.x_px), static_cast<float>(tile.y_px));
    glNamedBufferSubData(uniforms_, 0, sizeof(uniforms), &uniforms);
  }

  absl::StatusOr<Target*> target(std::uint32_t width_px, std::uint32_t height_px) {
    ++use_;
    for (Target& one : targets_) {
      if (one.width_px == width_px && one.height_px == height_px) {
        one.last_use = use_;
        return &one;
      }
    }
    // A few sizes are kept: views of different size take turns.
    constexpr std::size_t kKept = 4;
    if (targets_.size() < kKept) {
      targets_.emplace_back();
    } else {
      std::sort(targets_.begin(), targets_.end(),
                [](const Target& a, const Target& b) { return a.last_use > b.last_use; });
      targets_.back().release();
    }
    Target& made = targets_.back();
    const auto width = static_cast<GLsizei>(width_px), height = static_cast<GLsizei>(height_px);
    GLuint fbos[2];
    glCreateFramebuffers(2, fbos);
    made.draw_fbo = fbos[0];
    made.read_fbo = fbos[1];
    glCreateRenderbuffers(1, &made.depth);
    glCreateRenderbuffers(1, &made.picture);
    glNamedRenderbufferStorage(made.picture, GL_SRGB8_ALPHA8, width, height);
    if (samples_ > 1) {
      glCreateRenderbuffers(1, &made.samples);
      glNamedRenderbufferStorageMultisample(made.samples, samples_, GL_SRGB8_ALPHA8, width, height);
      glNamedRenderbufferStorageMultisample(made.depth, samples_, GL_DEPTH_COMPONENT32F, width,
                                            height);
    } else {
      glNamedRenderbufferStorage(made.depth, GL_DEPTH_COMPONENT32F, width, height);
    }
    glNamedFramebufferRenderbuffer(made.draw_fbo, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                                   samples_ > 1 ? made.samples : made.picture);
    glNamedFramebufferRenderbuffer(made.draw_fbo, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, made.depth);
    glNamedFramebufferRenderbuffer(made.read_fbo, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                                   made.picture);
    const GLenum draw_state = glCheckNamedFramebufferStatus(made.draw_fbo, GL_FRAMEBUFFER);
    const GLenum read_state = glCheckNamedFramebufferStatus(made.read_fbo, GL_FRAMEBUFFER);
    absl::Status status = gl_failed("framebuffer");
    if (status.ok() &&
        (draw_state != GL_FRAMEBUFFER_COMPLETE || read_state != GL_FRAMEBUFFER_COMPLETE)) {
      status = absl::InternalError(absl::StrCat(
          "gl draw: framebuffer of ", width_px, "x", height_px, " px is incomplete, 0x",
          absl::Hex(draw_state), " 0x", absl::Hex(read_state)));
    }
    if (!status.ok()) {
      made.release();
      targets_.pop_back();
      return status;
    }
    made.width_px = width_px;
    made.height_px = height_px;
    made.last_use = use_;
    return &made;
  }

  absl::Status draw_tile(const FrameGeometry& geometry, const Tile& tile, bool shadows,
                         const ReliefSearch& search, Picture& picture, GLuint pixel_buffer) {
    auto found = target(tile.width_px, tile.height_px);
    if (!found.ok()) return found.status();
    const Target& target = **found;
    const auto width = static_cast<GLsizei>(tile.width_px),
               height = static_cast<GLsizei>(tile.height_px);
    glBindFramebuffer(GL_FRAMEBUFFER, target.draw_fbo);
    glViewport(0, 0, width, height);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthMask(GL_TRUE);
    const GLfloat black[4] = {0, 0, 0, 0};
    const GLfloat far_depth = 0.0F;
    glClearNamedFramebufferfv(target.draw_fbo, GL_COLOR, 0, black);
    glClearNamedFramebufferfv(target.draw_fbo, GL_DEPTH, 0, &far_depth);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, uniforms_);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, instances_.name());
    glEnable(GL_DEPTH_TEST);

    // Agents.
    glVertexArrayVertexBuffer(mesh_array_, 0, drawn_vertices_, 0, sizeof(BatchVertex));
    glVertexArrayElementBuffer(mesh_array_, drawn_indices_);
    glDisable(GL_BLEND);
    glDepthFunc(GL_GREATER);
    if (options_.two_sided) {
      glDisable(GL_CULL_FACE);
    } else {
      glEnable(GL_CULL_FACE);
    }
    if (!geometry.indices.empty()) {
      glUseProgram(agents_);
      glBindTextureUnit(0, base_color_);
      glBindTextureUnit(1, tint_mask_);
      glBindVertexArray(mesh_array_);
      if (options_.tones) bind_tones(geometry);
      if (options_.surroundings) {
        glUniform1f(1, listed_.top_relative_m);
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 11, figures_.name());
      }
      if (on_device_) {  // how many there are is known there
        glBindBuffer(GL_DRAW_INDIRECT_BUFFER, interop_->command());
        glDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, nullptr);
      } else {
        glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(geometry.indices.size()), GL_UNSIGNED_INT,
                       nullptr);
      }
    }

    reliefs_.draw(search);
    splats_.draw();

    // Shadows: the largest one at each sample, in alpha.
    glDepthMask(GL_FALSE);
    glDisable(GL_CULL_FACE);
    glEnable(GL_BLEND);
    if (shadows && !shades_.empty()) {
      glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_TRUE);
      glBlendEquation(GL_MAX);
      glUseProgram(blobs_);
      glBindVertexArray(empty_array_);
      glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(shades_.size()));
      if (!caster_counts_.empty()) {
        glUseProgram(cast_shadows_);
        glBindVertexArray(mesh_array_);
        glMultiDrawElements(GL_TRIANGLES, caster_counts_.data(), GL_UNSIGNED_INT,
                            caster_starts_.data(), static_cast<GLsizei>(caster_counts_.size()));
      }
      glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
      glBlendEquation(GL_FUNC_ADD);
    }

    if (shades_surroundings_) {  // floors: where something was drawn
      glBlendFuncSeparate(GL_ZERO, GL_ONE_MINUS_DST_ALPHA, GL_ONE, GL_ZERO);
      glDepthFunc(GL_LESS);
      glUseProgram(floors_);
      glBindVertexArray(empty_array_);
      glDrawArrays(GL_TRIANGLES, 0, 3);
    }

    // Ground and sky: colour times what the shadows leave; the picture's alpha is 1 again.
    glBlendFuncSeparate(GL_ONE_MINUS_DST_ALPHA, GL_ZERO, GL_ONE, GL_ZERO);
    glDepthFunc(GL_EQUAL);
    glUseProgram(background_);
    glBindVertexArray(empty_array_);
    glDrawArrays(GL_TRIANGLES, 0, 3);

    // Resolve and read back, rows from the top.
    if (samples_ > 1) {
      glBlitNamedFramebuffer(target.draw_fbo, target.read_fbo, 0, 0, width, height, 0, 0, width,
                             height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    }
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target.read_fbo);
    glPixelStorei(GL_PACK_ROW_LENGTH, static_cast<GLint>(picture.width_px));
    const std::size_t first =
        std::size_t{4} * (std::size_t{tile.y_px} * picture.width_px + tile.x_px);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, pixel_buffer);
    glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE,
                 pixel_buffer != 0 ? reinterpret_cast<void*>(first) : &picture.rgbx[first]);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    return gl_failed("draw");
  }

  std::shared_ptr<EglContext> context_;  // pictures that are fetched later share it
  ReadBack read_back_;
  std::shared_ptr<GlPicture> last_;  // may still be drawn
  std::shared_ptr<const Cast> cast_;
  ShaderOptions options_;
  GLint max_texture_px_ = 0, max_layers_ = 0, max_storage_bytes_ = 0;
  GLsizei samples_ = 4;
  GLuint agents_ = 0, blobs_ = 0, cast_shadows_ = 0, floors_ = 0, background_ = 0;
  MappedBuffer figures_;  // element::FigureCells
  element::FigureCells listed_;
  std::vector<std::uint32_t> figure_lists_;
  bool shades_surroundings_ = false;
  GLuint mesh_array_ = 0, empty_array_ = 0, uniforms_ = 0, base_color_ = 0, tint_mask_ = 0;
  MappedBuffer vertices_, indices_, instances_, tones_, tone_shifts_;
  std::vector<std::uint32_t> first_tone_;  // of tones_, by member of the cast
  std::vector<std::uint32_t> shift_scratch_;
  ReliefPass reliefs_;
  SplatPass splats_;
  std::unique_ptr<CudaInterop> interop_;  // null: vertices come from the host
  std::string interop_note_;
  bool on_device_ = false;                         // what is drawn now
  GLuint drawn_vertices_ = 0, drawn_indices_ = 0;  // of this frame
  std::vector<Target> targets_;
  std::uint64_t use_ = 0;
  std::vector<InstanceShade> shades_;
  std::vector<std::uint32_t> casters_;
  std::vector<GLsizei> caster_counts_;
  std::vector<const void*> caster_starts_;
  WorkPool pool_;
  SmoothScratch smooth_scratch_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Rasterizer>> make_gl_rasterizer(unsigned threads, bool hardware_only,
                                                               BackendKind compute) {
  int device = -1;
#if THRONG_WITH_CUDA
  if (compute == BackendKind::kCuda) device = interop_device().value_or(-1);
#endif
  auto context = EglContext::make(device);
  if (!context.ok()) return context.status();
  if (hardware_only && (*context)->software()) {
    return absl::FailedPreconditionError(
        absl::StrCat("OpenGL is software here (", (*context)->renderer(), ")",
                     (*context)->passed_by().empty() ? "" : ": ", (*context)->passed_by()));
  }
  auto rasterizer = std::make_unique<GlRasterizer>(std::move(*context), threads);
  if (auto status = rasterizer->prepare(); !status.ok()) return status;
  if (device >= 0) rasterizer->share_with(device);
  return rasterizer;
}

}  // namespace throng::render::gl
