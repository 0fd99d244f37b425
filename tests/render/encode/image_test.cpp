#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "support/image_compare.hpp"
#include "throng/render/encode.hpp"

namespace throng::render {
namespace {

using ::testing::HasSubstr;

/// A smooth picture with some structure.
std::vector<std::uint8_t> pattern(std::uint32_t width, std::uint32_t height) {
  std::vector<std::uint8_t> rgbx;
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      rgbx.push_back(static_cast<std::uint8_t>(x * 255 / width));
      rgbx.push_back(static_cast<std::uint8_t>(y * 255 / height));
      rgbx.push_back((x / 8 + y / 8) % 2 == 0 ? 60 : 180);
      rgbx.push_back(255);
    }
  }
  return rgbx;
}

std::vector<std::uint8_t> jpeg_of(std::uint32_t width, std::uint32_t height, int quality = 85) {
  JpegEncoder encoder;
  const auto bytes = encoder.encode(pattern(width, height), width, height, quality);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return bytes.ok() ? std::vector<std::uint8_t>(bytes->begin(), bytes->end())
                    : std::vector<std::uint8_t>();
}

TEST(JpegTest, RoundTripKeepsPictureWithinQuality) {
  for (const auto& [width, height] : {std::pair{64u, 48u}, {1u, 1u}, {3u, 7u}, {17u, 33u}}) {
    const auto decoded = decode_jpeg(jpeg_of(width, height, 95));
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->width_px, width);
    EXPECT_EQ(decoded->height_px, height);
    EXPECT_GT(test::compare_images(decoded->rgbx, pattern(width, height)).psnr_db, 20.0);
    for (std::size_t i = 3; i < decoded->rgbx.size(); i += 4) ASSERT_EQ(decoded->rgbx[i], 255);
  }
}

TEST(JpegTest, HigherQualityTakesMoreBytesAndIsCloser) {
  const auto low = jpeg_of(64, 64, 30), high = jpeg_of(64, 64, 95);
  EXPECT_LT(low.size(), high.size());
  EXPECT_LT(test::compare_images(decode_jpeg(low)->rgbx, pattern(64, 64)).psnr_db,
            test::compare_images(decode_jpeg(high)->rgbx, pattern(64, 64)).psnr_db);
}

TEST(JpegTest, OneEncoderTakesPicturesOfAnySize) {
  JpegEncoder encoder;
  for (const std::uint32_t side : {64u, 8u, 128u, 5u}) {
    const auto bytes = encoder.encode(pattern(side, side), side, side, 80);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    EXPECT_EQ(decode_jpeg(*bytes)->width_px, side);
  }
}

TEST(JpegTest, EncodeRejectsWrongSizeAndQuality) {
  JpegEncoder encoder;
  const auto pixels = pattern(8, 8);
  EXPECT_THAT(std::string(encoder.encode(pixels, 8, 9, 80).status().message()),
              HasSubstr("must have 288"));
  EXPECT_THAT(std::string(encoder.encode(pixels, 0, 8, 80).status().message()),
              HasSubstr("1 to 16384"));
  EXPECT_THAT(std::string(encoder.encode(pixels, 16385, 8, 80).status().message()),
              HasSubstr("16385"));
  EXPECT_THAT(std::string(encoder.encode(pixels, 8, 8, 0).status().message()),
              HasSubstr("quality is 0"));
  EXPECT_EQ(encoder.encode(pixels, 8, 8, 101).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(JpegTest, EveryTruncationIsAnError) {
  const auto jpeg = jpeg_of(40, 40);
  // the last two bytes are the end marker, which decoders do not insist on
  for (std::size_t size = 0; size + 2 < jpeg.size(); ++size) {
    const auto decoded = decode_jpeg(std::span(jpeg).first(size));
    ASSERT_FALSE(decoded.ok()) << size << " of " << jpeg.size() << " bytes";
    ASSERT_EQ(decoded.status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(JpegTest, DamagedBytesGiveAnErrorOrAPicture) {
  std::mt19937 random(1);
  const auto good = jpeg_of(40, 40);
  for (int round = 0; round < 3000; ++round) {
    auto jpeg = good;
    for (int i = 0; i < 3; ++i) jpeg[random() % jpeg.size()] = static_cast<std::uint8_t>(random());
    const auto decoded = decode_jpeg(jpeg);
    if (!decoded.ok()) {
      ASSERT_NE(decoded.status().code(), absl::StatusCode::kInternal);
    }
  }
}

TEST(JpegTest, SizeBeyondLimitIsRejectedBeforeMemoryIsTaken) {
  auto jpeg = jpeg_of(40, 40);
  for (std::size_t i = 0; i + 8 < jpeg.size(); ++i) {
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {  // start of frame: height, width
      jpeg[i + 5] = jpeg[i + 7] = 0xff;
      break;
    }
  }
  EXPECT_THAT(std::string(decode_jpeg(jpeg).status().message()), HasSubstr("1 to 16384"));
}

TEST(PngTest, RoundTripIsExact) {
  for (const auto& [width, height] : {std::pair{64u, 48u}, {1u, 1u}, {3u, 7u}, {255u, 2u}}) {
    const auto pixels = pattern(width, height);
    const auto png = encode_png(pixels, width, height);
    ASSERT_TRUE(png.ok()) << png.status();
    const auto decoded = decode_png(*png);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->width_px, width);
    EXPECT_EQ(decoded->height_px, height);
    EXPECT_EQ(decoded->rgbx, pixels);
  }
}

TEST(PngTest, SamePixelsGiveSameBytes) {
  EXPECT_EQ(*encode_png(pattern(33, 20), 33, 20), *encode_png(pattern(33, 20), 33, 20));
}

TEST(PngTest, EncodeRejectsWrongSize) {
  EXPECT_EQ(encode_png(pattern(4, 4), 4, 5).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(encode_png({}, 0, 0).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(PngTest, EveryTruncationIsAnErrorOrTheSamePicture) {
  const auto pixels = pattern(20, 20);
  const auto png = *encode_png(pixels, 20, 20);
  for (std::size_t size = 0; size < png.size(); ++size) {
    const auto decoded = decode_png(std::span(png).first(size));
    // a missing checksum or end chunk loses no pixel
    if (decoded.ok()) {
      ASSERT_GT(size + 30, png.size());
      ASSERT_EQ(decoded->rgbx, pixels);
    } else {
      ASSERT_EQ(decoded.status().code(), absl::StatusCode::kInvalidArgument) << decoded.status();
    }
  }
}

TEST(PngTest, DamagedBytesGiveAnErrorOrAPicture) {
  std::mt19937 random(2);
  const auto good = *encode_png(pattern(20, 20), 20, 20);
  for (int round = 0; round < 3000; ++round) {
    auto png = good;
    for (int i = 0; i < 3; ++i) png[random() % png.size()] = static_cast<std::uint8_t>(random());
    const auto decoded = decode_png(png);
    if (!decoded.ok()) {
      ASSERT_EQ(decoded.status().code(), absl::StatusCode::kInvalidArgument);
    }
  }
}

/// CRC-32 as in the PNG specification, annex D.
std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = (crc & 1u) != 0 ? 0xedb88320u ^ (crc >> 1) : crc >> 1;
  }
  return ~crc;
}

std::vector<std::uint8_t> with_size(std::vector<std::uint8_t> png, std::uint32_t width,
                                    std::uint32_t height) {
  for (int i = 0; i < 4; ++i) {
    png[16 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(width >> (24 - 8 * i));
    png[20 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(height >> (24 - 8 * i));
  }
  const std::uint32_t crc = crc_of(std::span(png).subspan(12, 17));
  for (int i = 0; i < 4; ++i)
    png[29 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
  return png;
}

TEST(PngTest, SizeBeyondLimitOrFileIsRejectedBeforeMemoryIsTaken) {
  const auto png = *encode_png(pattern(4, 4), 4, 4);
  EXPECT_THAT(std::string(decode_png(with_size(png, 16385, 4)).status().message()),
              HasSubstr("1 to 16384"));
  EXPECT_THAT(std::string(decode_png(with_size(png, 16384, 16384)).status().message()),
              HasSubstr("cannot hold"));
}

TEST(PngTest, AnythingElseIsRejected) {
  EXPECT_EQ(decode_png({}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(decode_png(jpeg_of(8, 8)).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(decode_jpeg(*encode_png(pattern(4, 4), 4, 4)).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(decode_jpeg({}).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace throng::render
