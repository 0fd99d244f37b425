#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <absl/strings/str_cat.h>

#include <cstring>
#include <exception>
#include <new>

#include "render/encode/image_size.hpp"
#include "throng/render/encode.hpp"

namespace throng::render {
namespace {

/// A file in memory; OpenEXR goes back to fill in where the rows are.
class MemoryStream final : public Imf::OStream {
 public:
  explicit MemoryStream(std::vector<std::uint8_t>& bytes) : OStream("memory"), bytes_(bytes) {}
  void write(const char* data, int size_bytes) override {
    const auto size = static_cast<std::size_t>(size_bytes);
    if (bytes_.size() < place_ + size) bytes_.resize(place_ + size);
    std::memcpy(bytes_.data() + place_, data, size);
    place_ += size;
  }
  std::uint64_t tellp() override { return place_; }
  void seekp(std::uint64_t place) override { place_ = static_cast<std::size_t>(place); }

 private:
  std::vector<std::uint8_t>& bytes_;
  std::size_t place_ = 0;
};

}  // namespace

absl::StatusOr<std::vector<std::uint8_t>> encode_exr(std::span<const ExrChannel> channels,
                                                     std::uint32_t width_px,
                                                     std::uint32_t height_px,
                                                     const std::string& comment) {
  if (channels.empty()) return absl::InvalidArgumentError("encode_exr: 0 channels, at least 1");
  for (const ExrChannel& channel : channels) {
    const std::size_t size_bytes =
        std::visit([](const auto& values) { return values.size_bytes(); }, channel.values);
    if (auto status = check_image("encode_exr", size_bytes, width_px, height_px); !status.ok()) {
      return status;
    }
  }
  std::vector<std::uint8_t> bytes;
  try {
    Imf::Header header(static_cast<int>(width_px), static_cast<int>(height_px));
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::addComments(header, comment);
    Imf::FrameBuffer frame;
    for (const ExrChannel& channel : channels) {
      const bool is_float = channel.values.index() == 0;
      const void* first =
          std::visit([](const auto& values) { return static_cast<const void*>(values.data()); },
                     channel.values);
      const Imf::PixelType type = is_float ? Imf::FLOAT : Imf::UINT;
      header.channels().insert(channel.name, Imf::Channel(type));
      // read only, but a Slice serves readers too
      frame.insert(channel.name, Imf::Slice(type, static_cast<char*>(const_cast<void*>(first)), 4,
                                            std::size_t{4} * width_px));
    }
    MemoryStream stream(bytes);
    Imf::OutputFile file(stream, header, 0);  // 0: in this thread
    file.setFrameBuffer(frame);
    file.writePixels(static_cast<int>(height_px));
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat("encode_exr: no memory for ", width_px, "x", height_px, " px"));
  } catch (const std::exception& error) {
    return absl::InternalError(
        absl::StrCat("encode_exr: ", width_px, "x", height_px, " px: ", error.what()));
  }
  return bytes;
}

}  // namespace throng::render
