#include "io/version.hpp"

namespace subworld {

const char* version_text() noexcept { return SUBWORLD_VERSION; }

}  // namespace subworld
