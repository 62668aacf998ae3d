#pragma once

#include <string>
#include <string_view>

namespace subworld {

/// The text of idl/subworld.idl.
[[nodiscard]] std::string_view wire_idl();

/// The IDL of one struct and of those that it consists of, without comments. A typedef of an array becomes a struct of
/// as many fields, which has the same bytes: the viewers' parser knows no sequence of arrays. Throws `Error` (failed)
/// if the IDL does not have the struct.
[[nodiscard]] std::string schema_of(std::string_view idl, const std::string& name);

/// The IDL of `foxglove::SceneUpdate`, with the fields of the public schema in their order.
[[nodiscard]] std::string_view scene_update_schema();

}  // namespace subworld
