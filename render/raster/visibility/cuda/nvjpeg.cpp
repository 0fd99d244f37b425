#include "render/raster/visibility/cuda/nvjpeg.hpp"

#include <absl/strings/str_cat.h>

#include <new>
#include <utility>

#if THRONG_WITH_NVJPEG
#include <dlfcn.h>
#include <nvjpeg.h>
#endif

namespace throng::render::visibility::cuda {

#if THRONG_WITH_NVJPEG

namespace {

/// The library's functions, of the types its header gives them.
struct Library {
#define THRONG_NVJPEG_FUNCTIONS(do_with)                                                \
  do_with(nvjpegCreateSimple) do_with(nvjpegDestroy) do_with(nvjpegEncoderStateCreate)  \
      do_with(nvjpegEncoderStateDestroy) do_with(nvjpegEncoderParamsCreate)             \
          do_with(nvjpegEncoderParamsDestroy) do_with(nvjpegEncoderParamsSetQuality)    \
              do_with(nvjpegEncoderParamsSetSamplingFactors) do_with(nvjpegEncodeImage) \
                  do_with(nvjpegEncodeRetrieveBitstream)
#define THRONG_NVJPEG_DECLARE(name) decltype(&::name) name = nullptr;
  THRONG_NVJPEG_FUNCTIONS(THRONG_NVJPEG_DECLARE)
#undef THRONG_NVJPEG_DECLARE
  std::string name, error;  // one of them is empty

  Library() {
    // of the header's major version only: its types hold for no other
    name = absl::StrCat("libnvjpeg.so.", NVJPEG_VER_MAJOR);
    void* handle = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (handle == nullptr) {
      const char* why = dlerror();
      error = why != nullptr ? why : absl::StrCat(name, ": not found");
      return;
    }
#define THRONG_NVJPEG_FIND(function)                                         \
  function = reinterpret_cast<decltype(function)>(dlsym(handle, #function)); \
  if (function == nullptr) error = absl::StrCat(name, " has no ", #function);
    THRONG_NVJPEG_FUNCTIONS(THRONG_NVJPEG_FIND)
#undef THRONG_NVJPEG_FIND
#undef THRONG_NVJPEG_FUNCTIONS
  }
};

const Library& library() {
  static const Library once;  // stays loaded
  return once;
}

absl::Status to_status(nvjpegStatus_t status, const char* call) {
  if (status == NVJPEG_STATUS_SUCCESS) return absl::OkStatus();
  const std::string text =
      absl::StrCat(call, ": nvJPEG's status is ", static_cast<int>(status), " (nvjpegStatus_t)");
  return status == NVJPEG_STATUS_ALLOCATOR_FAILURE ? absl::ResourceExhaustedError(text)
                                                   : absl::InternalError(text);
}

#define THRONG_NVJPEG_TRY(expression, call) \
  if (absl::Status status = to_status(expression, call); !status.ok()) return status

}  // namespace

struct NvJpeg::State {
  nvjpegHandle_t handle = nullptr;
  nvjpegEncoderState_t encoder = nullptr;
  nvjpegEncoderParams_t params = nullptr;
  ~State() {
    if (params != nullptr) library().nvjpegEncoderParamsDestroy(params);
    if (encoder != nullptr) library().nvjpegEncoderStateDestroy(encoder);
    if (handle != nullptr) library().nvjpegDestroy(handle);
  }
};

absl::StatusOr<std::unique_ptr<NvJpeg>> NvJpeg::make(cudaStream_t stream) {
  const Library& calls = library();
  if (!calls.error.empty()) return absl::UnimplementedError(calls.error);
  auto state = std::make_unique<State>();
  THRONG_NVJPEG_TRY(calls.nvjpegCreateSimple(&state->handle), "nvjpegCreateSimple");
  THRONG_NVJPEG_TRY(calls.nvjpegEncoderStateCreate(state->handle, &state->encoder, stream),
                    "nvjpegEncoderStateCreate");
  THRONG_NVJPEG_TRY(calls.nvjpegEncoderParamsCreate(state->handle, &state->params, stream),
                    "nvjpegEncoderParamsCreate");
  THRONG_NVJPEG_TRY(
      calls.nvjpegEncoderParamsSetSamplingFactors(state->params, NVJPEG_CSS_420, stream),
      "nvjpegEncoderParamsSetSamplingFactors");
  return std::unique_ptr<NvJpeg>(new NvJpeg(std::move(state)));
}

absl::Status NvJpeg::encode(std::uint8_t* rgb, std::uint32_t width_px, std::uint32_t height_px,
                            int quality, cudaStream_t stream, std::vector<std::uint8_t>& jpeg) {
  if (quality < 1 || quality > 100) {
    return absl::InvalidArgumentError(
        absl::StrCat("nvjpegEncodeImage: quality is ", quality, ", must be 1 to 100"));
  }
  const Library& calls = library();
  THRONG_NVJPEG_TRY(calls.nvjpegEncoderParamsSetQuality(state_->params, quality, stream),
                    "nvjpegEncoderParamsSetQuality");
  nvjpegImage_t image{};
  image.channel[0] = rgb;
  image.pitch[0] = 3 * static_cast<std::size_t>(width_px);
  THRONG_NVJPEG_TRY(calls.nvjpegEncodeImage(state_->handle, state_->encoder, state_->params, &image,
                                            NVJPEG_INPUT_RGBI, static_cast<int>(width_px),
                                            static_cast<int>(height_px), stream),
                    "nvjpegEncodeImage");
  // its length first; what drew the picture may have gone wrong too, and is told here
  std::size_t size_bytes = 0;
  THRONG_NVJPEG_TRY(calls.nvjpegEncodeRetrieveBitstream(state_->handle, state_->encoder, nullptr,
                                                        &size_bytes, stream),
                    "nvjpegEncodeRetrieveBitstream");
  if (const cudaError_t error = cudaStreamSynchronize(stream); error != cudaSuccess) {
    return absl::InternalError(absl::StrCat("nvjpegEncodeImage: ", cudaGetErrorString(error)));
  }
  try {
    jpeg.resize(size_bytes);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat("nvjpegEncodeImage: no memory for ", size_bytes, " bytes"));
  }
  THRONG_NVJPEG_TRY(calls.nvjpegEncodeRetrieveBitstream(state_->handle, state_->encoder,
                                                        jpeg.data(), &size_bytes, stream),
                    "nvjpegEncodeRetrieveBitstream");
  if (const cudaError_t error = cudaStreamSynchronize(stream); error != cudaSuccess) {
    return absl::InternalError(
        absl::StrCat("nvjpegEncodeRetrieveBitstream: ", cudaGetErrorString(error)));
  }
  jpeg.resize(size_bytes);
  return absl::OkStatus();
}

std::string jpeg_encoder_name() {
  const Library& calls = library();
  return calls.error.empty() ? absl::StrCat("nvJPEG (", calls.name, ")")
                             : absl::StrCat("libjpeg-turbo (", calls.error, ")");
}

#else

struct NvJpeg::State {};

absl::StatusOr<std::unique_ptr<NvJpeg>> NvJpeg::make(cudaStream_t) {
  return absl::UnimplementedError("nvJPEG is not built into this program");
}

absl::Status NvJpeg::encode(std::uint8_t*, std::uint32_t, std::uint32_t, int, cudaStream_t,
                            std::vector<std::uint8_t>&) {
  return absl::UnimplementedError("nvJPEG is not built into this program");
}

std::string jpeg_encoder_name() { return "libjpeg-turbo (nvJPEG is not built into this program)"; }

#endif

NvJpeg::NvJpeg(std::unique_ptr<State> state) : state_(std::move(state)) {}
NvJpeg::~NvJpeg() = default;

}  // namespace throng::render::visibility::cuda
