#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "throng/render/raster.hpp"

namespace throng::test {

inline std::string kind_name(const ::testing::TestParamInfo<render::RasterKind>& info) {
  return info.param == render::RasterKind::kGl ? "Gl" : "Visibility";
}

/// A rasterizer of the kind in the parameter; where this machine has none the test is skipped.
class RasterizerFixture : public ::testing::TestWithParam<render::RasterKind> {
 protected:
  void SetUp() override {
    auto made = render::make_rasterizer(GetParam(), 2);
    if (absl::IsUnavailable(made.status())) GTEST_SKIP() << made.status().message();
    ASSERT_TRUE(made.ok()) << made.status();
    rasterizer_ = std::move(*made);
  }

  std::unique_ptr<render::Rasterizer> rasterizer_;
};

}  // namespace throng::test
