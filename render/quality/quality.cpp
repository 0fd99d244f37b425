#include "throng/render/quality.hpp"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace throng::render {
namespace {

constexpr int kWindowRadius = 5;
constexpr double kSigma = 1.5;
using Window = std::array<double, 2 * kWindowRadius + 1>;

Window gaussian_window() {
  Window window;
  for (int i = -kWindowRadius; i <= kWindowRadius; ++i)
    window[i + kWindowRadius] = std::exp(-i * i / (2 * kSigma * kSigma));
  return window;
}

absl::Status check(const char* call, const Picture& picture, const Picture& reference,
                   std::span<const std::uint8_t> mask) {
  const std::uint64_t pixels = std::uint64_t{picture.width_px} * picture.height_px;
  if (picture.width_px != reference.width_px || picture.height_px != reference.height_px)
    return absl::InvalidArgumentError(
        absl::StrCat(call, ": pictures are ", picture.width_px, "x", picture.height_px, " and ",
                     reference.width_px, "x", reference.height_px, " px, must be of one size"));
  for (const Picture* each : {&picture, &reference})
    if (each->rgbx.size() != pixels * 4)
      return absl::InvalidArgumentError(absl::StrCat(call, ": a picture of ", each->width_px, "x",
                                                     each->height_px, " px has ", each->rgbx.size(),
                                                     " bytes, must have ", pixels * 4));
  if (!mask.empty() && mask.size() != pixels)
    return absl::InvalidArgumentError(
        absl::StrCat(call, ": mask has ", mask.size(), " pixels, must have ", pixels));
  return absl::OkStatus();
}

std::vector<float> luma(const Picture& picture) {
  std::vector<float> plane(picture.rgbx.size() / 4);
  for (std::size_t i = 0; i < plane.size(); ++i)
    plane[i] = 0.299f * picture.rgbx[4 * i] + 0.587f * picture.rgbx[4 * i + 1] +
               0.114f * picture.rgbx[4 * i + 2];
  return plane;
}

/// The window along one axis: `count` lines of `length` values, `step` apart in a line.
void blur_lines(std::vector<float>& plane, std::size_t count, std::size_t line_step,
                std::size_t length, std::size_t step, const Window& window) {
  std::vector<double> line(length);
  for (std::size_t l = 0; l < count; ++l) {
    float* values = plane.data() + l * line_step;
    for (std::size_t i = 0; i < length; ++i) line[i] = values[i * step];
    for (std::size_t i = 0; i < length; ++i) {
      const auto begin = i >= kWindowRadius ? i - kWindowRadius : 0;
      const auto end = std::min(length, i + kWindowRadius + 1);
      double sum = 0, weight = 0;
      for (std::size_t j = begin; j < end; ++j) {
        const double w = window[j + kWindowRadius - i];
        sum += w * line[j];
        weight += w;
      }
      values[i * step] = static_cast<float>(sum / weight);
    }
  }
}

std::vector<float> blurred(std::vector<float> plane, std::size_t width, std::size_t height,
                           const Window& window) {
  blur_lines(plane, height, width, width, 1, window);
  blur_lines(plane, width, 1, height, width, window);
  return plane;
}

std::vector<float> product(const std::vector<float>& a, const std::vector<float>& b) {
  std::vector<float> result(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) result[i] = a[i] * b[i];
  return result;
}

double mean_change(const Picture& before, const Picture& after,
                   std::span<const std::uint8_t> mask) {
  std::uint64_t sum = 0, pixels = 0;
  for (std::size_t i = 0; i < before.rgbx.size() / 4; ++i) {
    if (!mask.empty() && mask[i] == 0) continue;
    ++pixels;
    for (int c = 0; c < 3; ++c)
      sum += std::abs(int{after.rgbx[4 * i + c]} - int{before.rgbx[4 * i + c]});
  }
  return pixels == 0 ? 0 : static_cast<double>(sum) / static_cast<double>(3 * pixels);
}

}  // namespace

absl::StatusOr<PictureError> compare_pictures(const Picture& picture, const Picture& reference,
                                              std::span<const std::uint8_t> mask) {
  if (auto status = check("compare_pictures", picture, reference, mask); !status.ok())
    return status;
  const std::size_t width = picture.width_px, height = picture.height_px;
  const Window window = gaussian_window();
  const std::vector<float> x = luma(picture), y = luma(reference);
  const auto mean_x = blurred(x, width, height, window), mean_y = blurred(y, width, height, window);
  const auto mean_xx = blurred(product(x, x), width, height, window);
  const auto mean_yy = blurred(product(y, y), width, height, window);
  const auto mean_xy = blurred(product(x, y), width, height, window);

  constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);
  PictureError error;
  double ssim = 0;
  std::uint64_t squared = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!mask.empty() && mask[i] == 0) continue;
    ++error.pixels;
    for (int c = 0; c < 3; ++c) {
      const int difference = int{picture.rgbx[4 * i + c]} - int{reference.rgbx[4 * i + c]};
      squared += static_cast<std::uint64_t>(difference * difference);
    }
    const double mx = mean_x[i], my = mean_y[i];
    const double vx = mean_xx[i] - mx * mx, vy = mean_yy[i] - my * my, vxy = mean_xy[i] - mx * my;
    ssim += ((2 * mx * my + kC1) * (2 * vxy + kC2)) /
            ((mx * mx + my * my + kC1) * (std::max(vx, 0.0) + std::max(vy, 0.0) + kC2));
  }
  error.psnr_db = std::numeric_limits<double>::infinity();
  if (error.pixels == 0) return error;
  error.ssim = ssim / static_cast<double>(error.pixels);
  if (squared > 0)
    error.psnr_db = 10 * std::log10(255.0 * 255.0 * 3 * static_cast<double>(error.pixels) /
                                    static_cast<double>(squared));
  return error;
}

absl::StatusOr<double> flicker(const Picture& before, const Picture& after,
                               const Picture& reference_before, const Picture& reference_after,
                               std::span<const std::uint8_t> mask) {
  for (const Picture* each : {&after, &reference_before, &reference_after})
    if (auto status = check("flicker", before, *each, mask); !status.ok()) return status;
  const double change = mean_change(before, after, mask);
  const double reference = mean_change(reference_before, reference_after, mask);
  if (reference == 0) return change == 0 ? 1 : std::numeric_limits<double>::infinity();
  return change / reference;
}

absl::StatusOr<std::vector<std::uint8_t>> pixels_near(std::span<const std::uint8_t> covered,
                                                      std::span<const std::uint8_t> covered_too,
                                                      std::uint32_t width_px,
                                                      std::uint32_t height_px,
                                                      std::uint32_t radius_px) {
  const std::size_t width = width_px, height = height_px;
  for (const auto& mask : {covered, covered_too})
    if (mask.size() != width * height)
      return absl::InvalidArgumentError(absl::StrCat("pixels_near: mask has ", mask.size(),
                                                     " pixels, must have ", width * height));
  // Distance to the nearest covered pixel of the row, then the best row above and below.
  const std::uint32_t far = std::min<std::uint32_t>(radius_px, 1u << 14) + 1;
  std::vector<std::uint32_t> in_row(width * height, far);
  for (std::size_t y = 0; y < height; ++y) {
    std::uint32_t* row = in_row.data() + y * width;
    std::uint32_t distance = far;
    for (std::size_t x = 0; x < width; ++x) {
      const bool on = covered[y * width + x] != 0 || covered_too[y * width + x] != 0;
      row[x] = distance = on ? 0 : std::min(distance + 1, far);
    }
    distance = far;
    for (std::size_t x = width; x-- > 0;) {
      distance = row[x] == 0 ? 0 : std::min(distance + 1, far);
      row[x] = std::min(row[x], distance);
    }
  }
  const std::int64_t radius = far - 1;
  std::vector<std::uint8_t> near(width * height);
  for (std::int64_t y = 0; y < static_cast<std::int64_t>(height); ++y) {
    const std::int64_t begin = std::max<std::int64_t>(0, y - radius);
    const std::int64_t end = std::min<std::int64_t>(height - 1, y + radius);
    for (std::size_t x = 0; x < width; ++x)
      for (std::int64_t row = begin; row <= end && near[y * width + x] == 0; ++row) {
        const std::int64_t dx = in_row[row * width + x], dy = row - y;
        near[y * width + x] = dx < far && dx * dx + dy * dy <= radius * radius;
      }
  }
  return near;
}

absl::StatusOr<double> silhouette_overlap(std::span<const std::uint8_t> covered,
                                          std::span<const std::uint8_t> covered_too) {
  if (covered.size() != covered_too.size())
    return absl::InvalidArgumentError(absl::StrCat("silhouette_overlap: masks have ",
                                                   covered.size(), " and ", covered_too.size(),
                                                   " pixels, must be of one size"));
  std::uint64_t both = 0, either = 0;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    both += covered[i] != 0 && covered_too[i] != 0;
    either += covered[i] != 0 || covered_too[i] != 0;
  }
  return either == 0 ? 1 : static_cast<double>(both) / static_cast<double>(either);
}

}  // namespace throng::render
