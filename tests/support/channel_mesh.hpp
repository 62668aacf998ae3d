#pragma once

#include <fmt/core.h>

#include <cmath>
#include <string>

/// Concave meshes as OBJ files.
namespace subworld::test {

/// A channel along z, 100 mm long: a floor of 100 mm x 10 mm, walls of 10 mm that are 60 mm high, open to +y.
inline constexpr const char* kChannel =
    "v -0.05 0 0\n"
    "v 0.05 0 0\n"
    "v 0.05 0.06 0\n"
    "v 0.04 0.06 0\n"
    "v 0.04 0.01 0\n"
    "v -0.04 0.01 0\n"
    "v -0.04 0.06 0\n"
    "v -0.05 0.06 0\n"
    "v -0.05 0 0.1\n"
    "v 0.05 0 0.1\n"
    "v 0.05 0.06 0.1\n"
    "v 0.04 0.06 0.1\n"
    "v 0.04 0.01 0.1\n"
    "v -0.04 0.01 0.1\n"
    "v -0.04 0.06 0.1\n"
    "v -0.05 0.06 0.1\n"
    "f 1 5 2\n"
    "f 9 10 13\n"
    "f 1 6 5\n"
    "f 9 13 14\n"
    "f 2 4 3\n"
    "f 10 11 12\n"
    "f 2 5 4\n"
    "f 10 12 13\n"
    "f 1 7 6\n"
    "f 9 14 15\n"
    "f 1 8 7\n"
    "f 9 15 16\n"
    "f 1 2 10\n"
    "f 1 10 9\n"
    "f 2 3 11\n"
    "f 2 11 10\n"
    "f 3 4 12\n"
    "f 3 12 11\n"
    "f 4 5 13\n"
    "f 4 13 12\n"
    "f 5 6 14\n"
    "f 5 14 13\n"
    "f 6 7 15\n"
    "f 6 15 14\n"
    "f 7 8 16\n"
    "f 7 16 15\n"
    "f 8 1 9\n"
    "f 8 9 16\n";
inline constexpr double kChannelVolume = 2e-4;  ///< m^3

/// A cup that stands on z = 0 and is open to +z, of so many sides: 80 mm high and wide, 4 mm thick.
inline std::string cup(int sides) {
  constexpr double kOutline[][2] = {{0.04, 0}, {0.04, 0.08}, {0.036, 0.08}, {0.036, 0.004}};
  std::string text = "v 0 0 0\nv 0 0 0.004\n";
  for (const auto& [r, z] : kOutline) {
    for (int i = 0; i < sides; ++i) {
      const double angle = 2.0 * M_PI * i / sides;
      text += fmt::format("v {} {} {}\n", r * std::cos(angle), r * std::sin(angle), z);
    }
  }
  for (int i = 0; i < sides; ++i) {
    const auto corner = [&](int ring, int side) { return 3 + ring * sides + (i + side) % sides; };
    text += fmt::format("f 1 {} {}\nf 2 {} {}\n", corner(0, 1), corner(0, 0), corner(3, 0), corner(3, 1));
    for (int ring = 0; ring < 3; ++ring)
      text += fmt::format("f {0} {1} {2} {3}\n", corner(ring, 0), corner(ring, 1), corner(ring + 1, 1),
                          corner(ring + 1, 0));
  }
  return text;
}

}  // namespace subworld::test
