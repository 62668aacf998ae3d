#pragma once

#include "model/exchange.hpp"

#include <subworld.h>

/// Converts model structs to the types of the IDL and back. Only `codec.cpp` includes this: IDL types stop here. Nested
/// types: parts.hpp. `from_wire` returns false for invalid contents and may then leave `out` half filled.
namespace subworld {

void to_wire(const SceneDescription& in, msg::Scene& out);
void to_wire(const DeviceState& in, msg::DeviceState& out);
void to_wire(const DeviceCommand& in, msg::DeviceCommand& out);
void to_wire(const WorldFrame& in, msg::WorldFrame& out);
void to_wire(const HapticReport& in, msg::HapticReport& out);
void to_wire(const WorldSnapshot& in, msg::WorldState& out);
void to_wire(const Control& in, msg::Control& out);
void to_wire(const Status& in, msg::Status& out);

[[nodiscard]] bool from_wire(const msg::Scene& in, SceneDescription& out);
[[nodiscard]] bool from_wire(const msg::DeviceState& in, DeviceState& out);
[[nodiscard]] bool from_wire(const msg::DeviceCommand& in, DeviceCommand& out);
[[nodiscard]] bool from_wire(const msg::WorldFrame& in, WorldFrame& out);
[[nodiscard]] bool from_wire(const msg::HapticReport& in, HapticReport& out);
[[nodiscard]] bool from_wire(const msg::WorldState& in, WorldSnapshot& out);
[[nodiscard]] bool from_wire(const msg::Control& in, Control& out);
[[nodiscard]] bool from_wire(const msg::Status& in, Status& out);

}  // namespace subworld
