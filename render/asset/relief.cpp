#include "throng/render/relief.hpp"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <utility>

#include "render/asset/layout.hpp"

namespace throng::render {
namespace {

template <typename... Parts>
absl::Status bad(const Parts&... parts) {
  return absl::InvalidArgumentError(absl::StrCat("impostor", parts...));
}

bool is_place(const glm::vec3& p) {
  return std::abs(p.x) <= layout::kMaxCoordinate_m && std::abs(p.y) <= layout::kMaxCoordinate_m &&
         std::abs(p.z) <= layout::kMaxCoordinate_m;
}

absl::Status check_box(const Relief& relief, std::size_t number, std::size_t joint_count) {
  const ReliefBox& box = relief.boxes[number];
  if (box.joint >= joint_count) {
    return bad(" box ", number, " has joint ", box.joint, ", must be below ", joint_count);
  }
  if (!is_place(box.origin)) return bad(" box ", number, " has an origin that is not finite");
  for (const glm::vec3& side : box.side) {
    const float length_m = glm::length(side);
    if (!is_place(side) || !(length_m > 1e-6F)) {
      return bad(" box ", number, " has a side of ", length_m, " m, must be over 1e-6");
    }
  }
  for (const ReliefFace& face : box.face) {
    if (face.width_px < 1 || face.height_px < 1) {
      return bad(" box ", number, " has a face of ", face.width_px, " x ", face.height_px,
                 " px, each must be at least 1");
    }
    if (face.first + relief_texels(face) > relief.shape.size()) {
      return bad(" box ", number, " has a face of ", face.width_px, " x ", face.height_px,
                 " px at texel ", face.first, ", must end by ", relief.shape.size());
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::shared_ptr<const Relief> make_relief(ReliefData data) {
  const auto owned = std::make_shared<const ReliefData>(std::move(data));
  auto relief = std::make_shared<Relief>();
  relief->capture_frame = owned->capture_frame;
  relief->texel_m = owned->texel_m;
  relief->boxes = owned->boxes;
  relief->shape = owned->shape;
  relief->color = owned->color;
  relief->tint = owned->tint;
  relief->storage = owned;
  return relief;
}

absl::Status validate_relief(const Relief& relief, std::size_t joint_count, std::size_t frames) {
  if (relief.boxes.empty() || relief.boxes.size() > layout::kMaxReliefBoxes) {
    return bad(" has ", relief.boxes.size(), " boxes, must have 1 to ", layout::kMaxReliefBoxes);
  }
  if (relief.shape.size() > layout::kMaxReliefTexels ||
      relief.color.size() != relief.shape.size() || relief.tint.size() != relief.shape.size()) {
    return bad(" has ", relief.shape.size(), ", ", relief.color.size(), " and ", relief.tint.size(),
               " texels, must have as many of each and at most ", layout::kMaxReliefTexels);
  }
  if (relief.capture_frame >= frames) {
    return bad(" was captured in frame ", relief.capture_frame, ", must be below ", frames);
  }
  if (!(relief.texel_m >= 0.0F && relief.texel_m <= layout::kMaxCoordinate_m)) {
    return bad(" has texels of ", relief.texel_m, " m, must be finite and not negative");
  }
  for (std::size_t i = 0; i < relief.boxes.size(); ++i) {
    if (auto status = check_box(relief, i, joint_count); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace throng::render
