#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <vector>

#include "throng/render/picture.hpp"

namespace throng::render {

/// How far a picture is from its reference, over the pixels that were asked for.
struct PictureError {
  double psnr_db = 0;        ///< over r, g and b; infinity for equal pixels
  double ssim = 1;           ///< mean structural similarity of luma, at most 1
  std::uint64_t pixels = 0;  ///< pixels compared; with none the pictures count as equal
};

/// Compares the pixels whose `mask` [height_px * width_px] is not 0; all of them if it is empty.
///
/// SSIM: luma (BT.601 weights on sRGB values), 11x11 Gaussian window of sigma 1.5, K1 = 0.01,
/// K2 = 0.03 (Wang, Bovik, Sheikh & Simoncelli 2004). Windows see all pixels, masked or not, and
/// are renormalised where the frame cuts them off.
/// InvalidArgument: a span of the wrong length or pictures of two sizes.
absl::StatusOr<PictureError> compare_pictures(const Picture& picture, const Picture& reference,
                                              std::span<const std::uint8_t> mask = {});

/// Mean absolute change from one frame to the next, divided by that of the reference frames, over
/// the same pixels: 1 is as calm as the reference, 2 flickers twice as much. 1 where nothing moves
/// in either, infinity where only the picture changes. Errors as compare_pictures.
absl::StatusOr<double> flicker(const Picture& before, const Picture& after,
                               const Picture& reference_before, const Picture& reference_after,
                               std::span<const std::uint8_t> mask = {});

/// Pixels at most `radius_px` (Euclidean, centre to centre) from a covered one of either mask
/// [height_px * width_px], as 1 and 0: where quality is judged with a radius of 8.
/// InvalidArgument: a mask of the wrong length.
absl::StatusOr<std::vector<std::uint8_t>> pixels_near(std::span<const std::uint8_t> covered,
                                                      std::span<const std::uint8_t> covered_too,
                                                      std::uint32_t width_px,
                                                      std::uint32_t height_px,
                                                      std::uint32_t radius_px);

/// Silhouette overlap: covered in both over covered in either; 1 if both are empty.
/// InvalidArgument: masks of two lengths.
absl::StatusOr<double> silhouette_overlap(std::span<const std::uint8_t> covered,
                                          std::span<const std::uint8_t> covered_too);

}  // namespace throng::render
