#pragma once

#include "throng/render/color_map.hpp"
#include "throng/v1/view.pb.h"

namespace throng::client {

inline v1::ColorMap wire_of(render::ColorMap map) {
  return static_cast<v1::ColorMap>(static_cast<int>(map) + 1);  // 0 is none
}

}  // namespace throng::client
