#pragma once

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <geos_c.h>

#include <functional>
#include <memory>
#include <string>

namespace throng::render {

/// A GEOS context that keeps what it complains about.
class Geos {
 public:
  Geos() : context_(GEOS_init_r()) {
    GEOSContext_setErrorMessageHandler_r(
        context_,
        [](const char* message, void* self) { static_cast<Geos*>(self)->complaint_ = message; },
        this);
  }
  ~Geos() { GEOS_finish_r(context_); }
  Geos(const Geos&) = delete;
  Geos& operator=(const Geos&) = delete;

  GEOSContextHandle_t get() const { return context_; }
  absl::Status error(const char* what) const {
    return absl::InvalidArgumentError(
        absl::StrCat("walkable area: ", what, complaint_.empty() ? "" : ": ", complaint_));
  }

 private:
  GEOSContextHandle_t context_;
  std::string complaint_;
};

using Geometry = std::unique_ptr<GEOSGeometry, std::function<void(GEOSGeometry*)>>;

inline Geometry own(const Geos& geos, GEOSGeometry* geometry) {
  return Geometry(geometry, [&geos](GEOSGeometry* g) { GEOSGeom_destroy_r(geos.get(), g); });
}

}  // namespace throng::render
