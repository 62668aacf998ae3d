#pragma once

#include <filesystem>
#include <string_view>

namespace subworld {

/// The folder of Subworld's programs, the plug-ins and the vendors' settings: that of this program. In a build it is
/// `bin`, installed it is `lib/subworld`. A program that is built with an installation uses the folder of that.
[[nodiscard]] std::filesystem::path program_folder();

/// The folder of `scenes` or `sessions`: `share/subworld/NAME` of an installation or `deploy/NAME` of a checkout, the
/// nearest above this program. Empty if there is none.
[[nodiscard]] std::filesystem::path data_folder(std::string_view name);

}  // namespace subworld
