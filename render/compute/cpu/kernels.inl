// The inner loops, compiled once for each instruction set: kernels.cpp includes this text in a
// namespace of its own, after `Lanes` (16 floats, four columns of a joint's matrix).

using element::InstanceState;

void advance(const element::Bracketed& moment, glm::vec4* place_m, std::size_t begin,
             std::size_t end) {
  for (std::size_t slot = begin; slot < end; ++slot) {
    if (moment.shown.present[slot] == 0) {
      place_m[slot] = glm::vec4(0.0F, 0.0F, 0.0F, -1.0F);
      continue;
    }
    place_m[slot] = glm::vec4(element::position_at(moment, slot), moment.shown.scale[slot]);
  }
}

PlacedInstance place(const CpuInstances& instances, std::size_t slot) {
  PlacedInstance placed;
  const std::vector<CharacterTable>& characters = instances.cast->characters;
  const std::size_t agents = instances.count - instances.surrounding;
  if (slot >= agents) {
    const auto member = instances.first_surrounding + static_cast<std::uint32_t>(slot - agents);
    placed.state = element::standing_still(member);
    placed.sphere_m = characters[member].character->bounds;
    return placed;
  }
  const CharacterTable& table = characters[instances.moment.shown.character[slot]];
  placed.state = element::advance_slot(instances.moment, table.gait, slot);
  placed.sphere_m =
      element::place_sphere(placed.state.placement, element::drawn_at(placed.state),
                            element::is_acting(placed.state.pose) ? table.character->bounds
                                                                  : table.character->gait_bounds);
  return placed;
}

std::uint32_t cull(const CullJob& job, std::size_t begin, std::size_t end) {
  const CpuInstances& instances = *job.instances;
  const auto exactly = [&](std::size_t slot) {
    return element::touches(
        job.frustum, element::relative_sphere(place(instances, slot).sphere_m, job.eye_offset_m));
  };
  std::uint32_t count = 0;
  std::size_t slot = begin;
  // Whose feet are farther from all planes than the figure reaches needs no pose. Planes relative
  // to the crowd's origin, in float: `slack_m` covers what that rounds.
  const std::size_t agents = end < job.agents ? end : job.agents;
  glm::vec4 planes[6];
  float slack_m = 1e-3F;
  for (int k = 0; k < 6; ++k) {
    const glm::vec4& plane = job.frustum.planes[k];
    const double away_m = static_cast<double>(plane.x) * job.eye_offset_m.x +
                          static_cast<double>(plane.y) * job.eye_offset_m.y +
                          static_cast<double>(plane.z) * job.eye_offset_m.z;
    planes[k] = glm::vec4(glm::vec3(plane), static_cast<float>(plane.w - away_m));
    slack_m += plane.w < 1e29F ? 1e-6F * static_cast<float>(std::fabs(away_m)) : 0.0F;
  }
  constexpr std::size_t kBlock = 64;
  float least_m[kBlock];
  while (slot < agents) {
    const std::size_t count_here = agents - slot < kBlock ? agents - slot : kBlock;
    const float* at = &instances.place_m[slot].x;
    for (std::size_t i = 0; i < count_here; ++i) {
      const float x = at[4 * i], y = at[4 * i + 1], z = at[4 * i + 2];
      float least = planes[0].x * x + (planes[0].y * y + (planes[0].z * z + planes[0].w));
      for (int k = 1; k < 6; ++k) {
        const float d = planes[k].x * x + (planes[k].y * y + (planes[k].z * z + planes[k].w));
        least = d < least ? d : least;
      }
      least_m[i] = least;
    }
    for (std::size_t i = 0; i < count_here; ++i, ++slot) {
      const glm::vec4& where = instances.place_m[slot];
      std::uint8_t is_visible = 0;
      if (where.w >= 0.0F) {
        const float reach_m =
            instances.cast->characters[instances.moment.shown.character[slot]].reach_m * where.w +
            slack_m + 1e-6F * (std::fabs(where.x) + std::fabs(where.y) + std::fabs(where.z));
        if (least_m[i] >= reach_m) {
          is_visible = 1;
        } else if (least_m[i] >= -reach_m) {
          is_visible = exactly(slot) ? 1 : 0;
        }
        if (is_visible != 0 && job.far_m > 0.0F &&
            element::feet_distance(glm::vec3(where), job.eye_offset_m) >= job.far_m) {
          is_visible = 0;
        }
        if (is_visible != 0 && job.is_near && element::is_at_eye(where, job.eye_offset_m)) {
          is_visible = 0;
        }
      }
      job.mask[slot] = is_visible;
      count += is_visible;
    }
  }
  for (; slot < end; ++slot) {
    job.mask[slot] = exactly(slot) ? 1 : 0;
    count += job.mask[slot];
  }
  return count;
}

inline void list(const CullJob& job, std::size_t slot, std::uint32_t v) {
  const PlacedInstance placed = place(*job.instances, slot);
  job.state[v] = placed.state;
  job.distance_m[v] =
      element::distance_of(element::relative_sphere(placed.sphere_m, job.eye_offset_m));
  job.visible[v] = element::make_visible(placed.state, placed.sphere_m.w,
                                         static_cast<std::uint32_t>(slot), job.eye_offset_m);
}

void compact(const CullJob& job, std::size_t begin, std::size_t end, std::uint32_t next) {
  for (std::size_t slot = begin; slot < end; ++slot) {
    if (job.mask[slot] != 0) list(job, slot, next++);
  }
}

Split split(const SplitJob& job, std::size_t begin, std::size_t end, std::uint32_t next) {
  Split made;
  const CullJob& cull = job.cull;
  const element::SpeckRule& rule = job.rule;
  const element::Bracketed& moment = cull.instances->moment;
  const element::SnapshotColumns& shown = moment.shown;
  for (std::size_t slot = begin; slot < end; ++slot) {
    if (cull.mask[slot] == 0) continue;
    if (slot < cull.agents && job.has_images[shown.character[slot]] != 0) {
      const std::uint32_t character = shown.character[slot];
      const CharacterTable& table = cull.instances->cast->characters[character];
      const glm::vec4& where = cull.instances->place_m[slot];
      const element::SpeckPlace at = element::speck_place(
          rule, glm::vec3(where), where.w, table.character->height_m, cull.eye_offset_m);
      if (element::may_be_speck(rule, at)) {
        const bool acts = shown.motion != nullptr && (shown.motion[slot] & 0xffffU) != 0;
        const std::uint32_t vertices =
            table.error.vertex_count[ErrorTable::step_of(rule.mixed.error_px / at.px_per_m)];
        float larger = 1.0F;
        const element::SpeckFate fate =
            element::speck_fate(rule, at, shown.seed[slot], acts, vertices, larger);
        if (fate == element::SpeckFate::kLeftOut) {
          ++made.left_out;
          continue;
        }
        if (fate == element::SpeckFate::kSpeck) {
          const element::Sample sample = element::sample_at(moment, table.gait, slot);
          const std::uint32_t pose =
              acts ? element::speck_pose(place(*cull.instances, slot).state.pose, table.gait)
                   : element::gait_speck_pose(table.gait, sample.speed_mps, sample.walked_cycles);
          job.specks[next + made.specks++] =
              element::make_speck(rule, at, larger, character, pose, sample.heading_rad,
                                  shown.seed[slot], element::channel_at(moment, slot));
          continue;
        }
      }
    }
    list(cull, slot, next + made.listed++);
  }
  return made;
}

void share(const element::Projection& projection, const VisibleInstance* visible,
           const float* distance_m, std::uint32_t* result, std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end; ++i) {
    result[i] = element::selection_share(
        element::selection_weight(projection, visible[i].radius_m, distance_m[i]));
  }
}

void pose_palette(const CharacterTable& table, const InstanceState& state,
                  std::uint32_t vertex_count, element::JointMatrix* palette) {
  const std::size_t joints = table.character->joint_count();
  const element::Pose& pose = state.pose;
  const element::JointMatrix* a0 = table.palette.data() + pose.a_frame0 * joints;
  const element::JointMatrix* a1 = table.palette.data() + pose.a_frame1 * joints;
  const std::uint32_t* order = table.joint_order.data();
  const std::uint32_t count = table.joint_count_at[vertex_count];
  const Placed placed(state.placement);
  const Lanes a_t = Lanes::all(pose.a_t);
  if (pose.c_weight > 0.0F) {
    const Lanes t[3] = {a_t, Lanes::all(pose.b_t), Lanes::all(pose.c_t)};
    const Lanes weight[3] = {a_t, Lanes::all(pose.b_weight), Lanes::all(pose.c_weight)};
    const std::uint32_t frame[3][2] = {{pose.a_frame0, pose.a_frame1},
                                       {pose.b_frame0, pose.b_frame1},
                                       {pose.c_frame0, pose.c_frame1}};
    for (std::uint32_t k = 0; k < count; ++k) {
      const element::JointMatrix* of_joint = table.palette.data() + order[k];
      Lanes mixed = a_t;
      for (int clip = 0; clip < 3; ++clip) {
        const Lanes from = Lanes::load(of_joint[frame[clip][0] * joints].m);
        const Lanes to = Lanes::load(of_joint[frame[clip][1] * joints].m);
        const Lanes posed = Lanes::fma(t[clip], Lanes::sub(to, from), from);
        mixed = clip == 0 ? posed : Lanes::fma(weight[clip], Lanes::sub(posed, mixed), mixed);
      }
      placed.store(mixed, palette[order[k]].m);
    }
    return;
  }
  if (!(pose.b_weight > 0.0F)) {
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t j = order[k];
      const Lanes from = Lanes::load(a0[j].m);
      placed.store(Lanes::fma(a_t, Lanes::sub(Lanes::load(a1[j].m), from), from), palette[j].m);
    }
    return;
  }
  const element::JointMatrix* b0 = table.palette.data() + pose.b_frame0 * joints;
  const element::JointMatrix* b1 = table.palette.data() + pose.b_frame1 * joints;
  const Lanes b_t = Lanes::all(pose.b_t);
  const Lanes b_weight = Lanes::all(pose.b_weight);
  for (std::uint32_t k = 0; k < count; ++k) {
    const std::uint32_t j = order[k];
    const Lanes a_from = Lanes::load(a0[j].m);
    const Lanes b_from = Lanes::load(b0[j].m);
    const Lanes a = Lanes::fma(a_t, Lanes::sub(Lanes::load(a1[j].m), a_from), a_from);
    const Lanes b = Lanes::fma(b_t, Lanes::sub(Lanes::load(b1[j].m), b_from), b_from);
    placed.store(Lanes::fma(b_weight, Lanes::sub(b, a), a), palette[j].m);
  }
}

inline Lanes blend(const TableVertex& vertex, const element::JointMatrix* palette) {
  Lanes m = Lanes::mul(Lanes::all(vertex.weight[0]), Lanes::load(palette[vertex.joint_index.x].m));
  m = Lanes::fma(Lanes::all(vertex.weight[1]), Lanes::load(palette[vertex.joint_index.y].m), m);
  m = Lanes::fma(Lanes::all(vertex.weight[2]), Lanes::load(palette[vertex.joint_index.z].m), m);
  return Lanes::fma(Lanes::all(vertex.weight[3]), Lanes::load(palette[vertex.joint_index.w].m), m);
}

#if THRONG_KERNEL_SIMD

/// Octahedral codes of four directions, x y z in the first three lanes of each: as
/// element::pack_octahedral.
inline __m128i pack_four(__m128 n0, __m128 n1, __m128 n2, __m128 n3) {
  _MM_TRANSPOSE4_PS(n0, n1, n2, n3);
  const __m128 x = n0, y = n1, z = n2;
  const __m128 sign = _mm_set1_ps(-0.0F);
  const __m128 one = _mm_set1_ps(1.0F);
  const __m128 zero = _mm_setzero_ps();
  const __m128 sum = _mm_add_ps(_mm_add_ps(_mm_andnot_ps(sign, x), _mm_andnot_ps(sign, y)),
                                _mm_andnot_ps(sign, z));
  const __m128 scale = _mm_and_ps(_mm_div_ps(one, sum), _mm_cmpgt_ps(sum, zero));
  __m128 u = _mm_mul_ps(x, scale);
  __m128 v = _mm_mul_ps(y, scale);
  // the lower half is folded over the corners: |v| - 1 or 1 - |v|, by the sign of u
  const __m128 fold = _mm_cmplt_ps(z, zero);
  const __m128 u_negative = _mm_and_ps(_mm_cmplt_ps(u, zero), sign);
  const __m128 v_negative = _mm_and_ps(_mm_cmplt_ps(v, zero), sign);
  const __m128 folded_u = _mm_xor_ps(_mm_sub_ps(one, _mm_andnot_ps(sign, v)), u_negative);
  const __m128 folded_v = _mm_xor_ps(_mm_sub_ps(one, _mm_andnot_ps(sign, u)), v_negative);
  u = _mm_blendv_ps(u, folded_u, fold);
  v = _mm_blendv_ps(v, folded_v, fold);
  const __m128 half = _mm_set1_ps(0.5F);
  const __m128 largest = _mm_set1_ps(32767.0F);
  const __m128 u_half = _mm_xor_ps(half, _mm_and_ps(_mm_cmplt_ps(u, zero), sign));
  const __m128 v_half = _mm_xor_ps(half, _mm_and_ps(_mm_cmplt_ps(v, zero), sign));
  const __m128i iu = _mm_cvttps_epi32(_mm_fmadd_ps(u, largest, u_half));
  const __m128i iv = _mm_cvttps_epi32(_mm_fmadd_ps(v, largest, v_half));
  return _mm_or_si128(_mm_and_si128(iu, _mm_set1_epi32(0xffff)), _mm_slli_epi32(iv, 16));
}

void skin(const TableVertex* vertices, const VisibleInstance& instance, std::uint32_t visible,
          const element::JointMatrix* palette, BatchVertex* out) {
  const __m128 feet = _mm_setr_ps(instance.position_relative.x, instance.position_relative.y,
                                  instance.position_relative.z, 0.0F);
  const std::uint32_t count = instance.vertex_count;
  for (std::uint32_t i = 0; i < count; i += 4) {
    __m128 normal[4];
    std::uint32_t index[4];
    for (std::uint32_t k = 0; k < 4; ++k) {
      // beyond the end the last vertex is made again, into its own place
      index[k] = i + k < count ? i + k : count - 1;
      const TableVertex& vertex = vertices[index[k]];
      const Lanes m = blend(vertex, palette);
      const __m128 c0 = m.column<0>(), c1 = m.column<1>(), c2 = m.column<2>(), c3 = m.column<3>();
      const __m128 position =
          _mm_fmadd_ps(c0, _mm_set1_ps(vertex.position_m.x),
                       _mm_fmadd_ps(c1, _mm_set1_ps(vertex.position_m.y),
                                    _mm_fmadd_ps(c2, _mm_set1_ps(vertex.position_m.z), c3)));
      normal[k] = _mm_fmadd_ps(c0, _mm_set1_ps(vertex.normal.x),
                               _mm_fmadd_ps(c1, _mm_set1_ps(vertex.normal.y),
                                            _mm_mul_ps(c2, _mm_set1_ps(vertex.normal.z))));
      // 16 bytes: the normal's place is written below
      _mm_storeu_ps(&out[index[k]].position_relative.x, _mm_add_ps(feet, position));
    }
    std::uint32_t code[4];
    _mm_storeu_si128(reinterpret_cast<__m128i*>(code),
                     pack_four(normal[0], normal[1], normal[2], normal[3]));
    for (std::uint32_t k = 0; k < 4; ++k) {
      BatchVertex& vertex = out[index[k]];
      std::memcpy(&vertex.normal, &code[k], sizeof vertex.normal);
      vertex.uv = vertices[index[k]].uv;
      vertex.visible = visible;
    }
  }
}

#else

void skin(const TableVertex* vertices, const VisibleInstance& instance, std::uint32_t visible,
          const element::JointMatrix* palette, BatchVertex* out) {
  for (std::uint32_t i = 0; i < instance.vertex_count; ++i) {
    const TableVertex& vertex = vertices[i];
    const Lanes m = blend(vertex, palette);
    const element::SkinnedVertex skinned =
        element::transform(m.v, vertex.position_m, vertex.normal);
    out[i].position_relative = instance.position_relative + skinned.position_m;
    const std::uint32_t code =
        element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z);
    std::memcpy(&out[i].normal, &code, sizeof code);
    out[i].uv = vertex.uv;
    out[i].visible = visible;
  }
}

#endif

void corners(const std::uint32_t* __restrict corner, std::size_t count,
             const std::uint32_t* __restrict target, std::uint32_t level_count,
             std::uint32_t vertex_count, std::uint32_t first_vertex,
             std::uint32_t* __restrict scratch, std::uint32_t* __restrict out) {
  if (level_count == vertex_count) {
    for (std::size_t k = 0; k < count; ++k) out[k] = first_vertex + corner[k];
    return;
  }
  // where each vertex of the level goes; a target is smaller, so it is known already
  for (std::uint32_t i = 0; i < vertex_count; ++i) scratch[i] = first_vertex + i;
  for (std::uint32_t i = vertex_count; i < level_count; ++i) scratch[i] = scratch[target[i]];
  for (std::size_t k = 0; k < count; ++k) out[k] = scratch[corner[k]];
}

constexpr Kernels kKernels = {advance, place,        cull, compact, split,
                              share,   pose_palette, skin, corners};
