#pragma once

namespace subworld {

/// Lower bound of the real-time factor, simulated seconds per second. A world that is too slow lowers its factor (time
/// dilation) down to this.
inline constexpr double kLeastRealTimeFactor = 0.02;

}  // namespace subworld
