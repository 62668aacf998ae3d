#pragma once

#include "model/types.hpp"

#include <vector>

namespace subworld::wasm {

// Layout in the modules' memory.
struct Float3 {
  float x, y, z;
};
struct Float4 {
  float x, y, z, w;
};

[[nodiscard]] inline Float3 to_module(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}
[[nodiscard]] inline Float4 to_module(const Quat& q) {
  return {static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()), static_cast<float>(q.w())};
}
[[nodiscard]] inline std::vector<Float3> to_module(const std::vector<Vec3>& all) {
  std::vector<Float3> result;
  result.reserve(all.size());
  for (const Vec3& v : all) result.push_back(to_module(v));
  return result;
}
[[nodiscard]] inline Vec3 from_module(const Float3& v) { return {v.x, v.y, v.z}; }
[[nodiscard]] inline Quat from_module(const Float4& q) { return Quat(q.w, q.x, q.y, q.z).normalized(); }

}  // namespace subworld::wasm
