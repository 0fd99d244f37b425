#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "render/raster/rasterizer_fixture.hpp"
#include "support/image_compare.hpp"
#include "support/raster_scene.hpp"
#include "throng/render/encode.hpp"

namespace throng::render {
namespace {

/// Pictures of mannequins against those in tests/data/golden, which gl on llvmpipe has drawn.
/// THRONG_UPDATE_GOLDEN=1 writes them anew: look at them before they are committed. A picture that
/// differs is left beside the test results.
class GoldenTest : public test::RasterizerFixture {
 protected:
  static constexpr Viewport kViewport{256, 160};

  void expect_golden(const std::string& name, const test::RasterScene& scene, const Camera& camera,
                     const Look& look = Look{}) {
    ASSERT_TRUE(rasterizer_->upload(test::mannequin_cast()).ok());
    Picture picture;
    const auto status =
        rasterizer_->draw(scene.geometry(), camera, kViewport, {0, 0, 0}, look, picture);
    ASSERT_TRUE(status.ok()) << status;
    const auto png = encode_png(picture.rgbx, picture.width_px, picture.height_px);
    ASSERT_TRUE(png.ok()) << png.status();
    const std::string golden =
        std::string(THRONG_SOURCE_DIR) + "/tests/data/golden/" + name + ".png";
    if (std::getenv("THRONG_UPDATE_GOLDEN") != nullptr && GetParam() == RasterKind::kGl) {
      ASSERT_TRUE(write_file(golden, *png).ok());
      GTEST_SKIP() << "written: " << golden;
    }
    std::ifstream file(golden, std::ios::binary);
    ASSERT_TRUE(file.good()) << golden << " is missing; THRONG_UPDATE_GOLDEN=1 writes it";
    const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
    const auto expected = decode_png(bytes);
    ASSERT_TRUE(expected.ok()) << expected.status();
    const test::ImageDifference difference = test::compare_images(picture.rgbx, expected->rgbx);
    // Another driver, another rasterizer or four samples a pixel move the edges by parts of a
    // pixel.
    const bool same_device = rasterizer_->info().name.find("llvmpipe") != std::string::npos &&
                             std::getenv("THRONG_GL_SAMPLES") == nullptr;
    const bool close = same_device ? difference.mean < 0.2 && difference.psnr_db > 40.0
                                   : difference.mean < 3.0 && difference.psnr_db > 27.0;
    if (!close) {
      const std::string actual = std::string(THRONG_BINARY_DIR) + "/test-results/" + name + ".png";
      std::error_code ignored;
      std::filesystem::create_directories(std::string(THRONG_BINARY_DIR) + "/test-results",
                                          ignored);
      (void)write_file(actual, *png);
      ADD_FAILURE() << name << ": mean " << difference.mean << ", max " << difference.max << ", "
                    << 100.0 * difference.share_over_8 << " % differ by more than 8, PSNR "
                    << difference.psnr_db << " dB; see " << actual;
    }
  }

  static Camera camera_at(const glm::dvec3& eye, const glm::dvec3& target) {
    Camera camera;
    camera.eye_world = eye;
    camera.target_world = target;
    return camera;
  }
};

TEST_P(GoldenTest, Near) {
  const Camera camera = camera_at({1.2, -3.2, 1.7}, {0, 0, 1.0});
  expect_golden("near", test::mannequin_crowd(camera, 9, 1.4F, 14), camera);
}

TEST_P(GoldenTest, Crowd) {
  const Camera camera = camera_at({0, -7, 3}, {0, 0, 0.7});
  expect_golden("crowd", test::mannequin_crowd(camera, 36, 1.5F), camera);
}

TEST_P(GoldenTest, CrowdByChannel) {
  const Camera camera = camera_at({0, -7, 3}, {0, 0, 0.7});
  Look look;
  look.color_by_channel = true;
  expect_golden("crowd_by_channel", test::mannequin_crowd(camera, 36, 1.5F), camera, look);
}

TEST_P(GoldenTest, Orthographic) {
  Camera camera = camera_at({-30, -30, 30}, {0, 0, 0});
  camera.ortho_height_m = 12.0;
  expect_golden("orthographic", test::mannequin_crowd(camera, 49, 1.6F), camera);
}

TEST_P(GoldenTest, FromAbove) {
  const Camera camera = camera_at({0, 0, 18}, {0, 0, 0});
  expect_golden("from_above", test::mannequin_crowd(camera, 49, 1.6F), camera);
}

TEST_P(GoldenTest, GrazingGround) {
  const Camera camera = camera_at({3, -40, 1.7}, {0, 0, 1.6});
  expect_golden("grazing_ground", test::RasterScene{}, camera);
}

INSTANTIATE_TEST_SUITE_P(Kinds, GoldenTest,
                         ::testing::Values(RasterKind::kGl, RasterKind::kVisibility),
                         test::kind_name);

}  // namespace
}  // namespace throng::render
