#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "render/compute/cpu/buffer.hpp"
#include "render/compute/cpu/cast_table.hpp"

namespace throng::render {

/// Posed meshes that agents share, by character and shared pose; a coarser level takes the first
/// vertices of a finer one's mesh. They stay from frame to frame until the block is full; then it
/// is left to the views that still use it and a new one is begun.
///
/// What a mesh holds is a function of its character, pose and size alone, so it does not matter who
/// made it or when.
class PosedBank {
 public:
  /// @param limit_bytes  of one block.
  explicit PosedBank(std::uint64_t limit_bytes = kDefaultLimitBytes) : limit_(limit_bytes) {}

  static constexpr std::uint64_t kDefaultLimitBytes = std::uint64_t{256} << 20;

  /// A mesh that is wanted. `vertices` at least.
  struct Want {
    std::uint32_t mesh;  // number_of
    std::uint32_t vertices;
  };
  struct Mesh {
    std::uint32_t first = 0;   // value in the block
    std::uint32_t stride = 0;  // vertices from column to column; 0: not there
  };
  using Block = Buffer<float>;

  /// Forgets everything when `cast` is another one.
  void use(const std::shared_ptr<const CastTable>& cast);

  static std::uint32_t number_of(std::uint32_t character, std::uint32_t pose);
  bool has(const Want& want) const { return meshes_[want.mesh].stride >= want.vertices; }
  const Mesh& mesh(std::uint32_t number) const { return meshes_[number]; }

  /// Makes room for the wanted meshes (sorted and made unique in place), which are to be filled in
  /// before anybody looks. False: they were not there all at once; everything was forgotten, so
  /// that the caller must want all of its meshes again. ResourceExhausted beyond the limit.
  absl::StatusOr<bool> reserve(std::vector<Want>& wanted);

  const std::shared_ptr<Block>& block() const { return block_; }
  float* data() { return block_->data(); }
  std::uint64_t used_bytes() const { return 4 * used_; }

 private:
  std::uint64_t limit_;
  std::shared_ptr<const CastTable> cast_;
  std::vector<Mesh> meshes_;
  std::shared_ptr<Block> block_;
  std::uint64_t used_ = 0;  // values
};

}  // namespace throng::render
