#pragma once

#include "model/error.hpp"
#include "model/scene/scene.hpp"
#include "support/temporary_folder.hpp"

#include <string>

namespace subworld {

/// The message with which a file is refused, without the folder's path; empty if it loads.
inline std::string refusal(const std::string& file, const std::string& folder) {
  try {
    (void)load_scene(file);
    return "";
  } catch (const Error& e) {
    std::string message = e.what();
    const std::string prefix = folder + "/";
    if (message.starts_with(prefix)) message.erase(0, prefix.size());
    return e.code() == ExitCode::usage ? message : "wrong exit code: " + message;
  }
}

inline Scene load_text(const std::string& text) {
  const TemporaryFolder folder;
  return load_scene(folder.write("scene.yaml", text));
}

namespace test {

/// An operator turns an admittance device of six degrees of freedom by 20 degrees and moves it by 2 cm, within half a
/// second; the proxy is free.
inline constexpr const char* kTurningAdmittanceDevice = R"(
name: turning
settings: {duration_s: 1}
bodies:
  - {name: floor, shape: plane, fixed: true, position_m: [0, 0, -1]}
users:
  - name: user
    proxy: {shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.5, position_m: [0, 0, 0], gravity: false}
    device:
      kind: admittance
      degrees_of_freedom: 6
      torque_limit_n_m: 2
      path:
        - {turn: {axis: [0, 0, 1], angle_deg: 20}, during_s: [0.1, 0.5]}
        - {move: [0.02, 0, 0], during_s: [0.1, 0.5]}
      operator: {mass_kg: 1, damping_n_s_m: 10, stiffness_n_m: 300, inertia_kg_m2: 0.005, rotational_damping_n_m_s_rad: 0.1, rotational_stiffness_n_m_rad: 3}
)";

}  // namespace test

}  // namespace subworld
