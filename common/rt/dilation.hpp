#pragma once

namespace subworld {

/// A world that cannot keep up slows its clock (time dilation), but not below this, simulated seconds per second.
inline constexpr double kLeastRealTimeFactor = 0.02;

}  // namespace subworld
