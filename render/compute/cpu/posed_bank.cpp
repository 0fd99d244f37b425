#include "render/compute/cpu/posed_bank.hpp"

#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

#include <algorithm>

#include "render/compute/element/posed.hpp"
#include "render/compute/element/shared_pose.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {
namespace {

using element::kPosedLanes;
static_assert(element::posed_values(1) == kPosedHeader + 4);

}  // namespace

std::uint32_t PosedBank::number_of(std::uint32_t character, std::uint32_t pose) {
  return character * element::kSharedPoses + pose;
}

void PosedBank::use(const std::shared_ptr<const CastTable>& cast) {
  if (cast == cast_) return;
  cast_ = cast;
  // surroundings, which may be thousands, come last and never share
  const std::vector<bool>& is_listed = cast->levels.is_listed;
  const auto last = std::find(is_listed.rbegin(), is_listed.rend(), true);
  const auto characters = static_cast<std::size_t>(is_listed.rend() - last);
  meshes_.assign(characters * element::kSharedPoses, {});
  block_.reset();
  used_ = 0;
}

absl::StatusOr<bool> PosedBank::reserve(std::vector<Want>& wanted) {
  std::sort(wanted.begin(), wanted.end(), [](const Want& a, const Want& b) {
    return a.mesh != b.mesh ? a.mesh < b.mesh : a.vertices > b.vertices;
  });
  wanted.erase(std::unique(wanted.begin(), wanted.end(),
                           [](const Want& a, const Want& b) { return a.mesh == b.mesh; }),
               wanted.end());
  std::uint64_t values = 0;
  for (Want& want : wanted) {
    want.vertices = (want.vertices + kPosedLanes - 1) / kPosedLanes * kPosedLanes;
    values += element::posed_values(want.vertices);
  }
  if (values == 0) return true;
  if (block_ == nullptr || used_ + values > block_->size()) {
    if (used_ > 0) {
      std::fill(meshes_.begin(), meshes_.end(), Mesh{});
      used_ = 0;
      block_.reset();
      return false;
    }
    if (4 * values > limit_) {
      return absl::ResourceExhaustedError(
          absl::StrCat("generate: the posed meshes of one frame need ", 4 * values,
                       " bytes, at most ", limit_, "; lower the vertex budget"));
    }
    block_ = std::make_shared<Block>();
    block_->resize_exactly(limit_ / 4);  // untouched pages cost nothing
  }
  for (const Want& want : wanted) {
    meshes_[want.mesh] = {static_cast<std::uint32_t>(used_), want.vertices};
    used_ += element::posed_values(want.vertices);
  }
  return true;
}

}  // namespace throng::render
