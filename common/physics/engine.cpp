#include "physics/engine.hpp"

#include "model/error.hpp"
#include "physics/bullet.hpp"
#ifdef SUBWORLD_HAVOK
#include "physics/havok/havok.hpp"
#endif
#ifdef SUBWORLD_PHYSX
#include "physics/physx/physx.hpp"
#endif

#include <fmt/format.h>

#include <string>

namespace subworld {

namespace {

struct Maker {
  std::string_view name;
  std::unique_ptr<Engine> (*make)(const EngineSettings&, std::span<const Mesh>);
};

constexpr Maker kMakers[] = {
    {"bullet", make_bullet},
#ifdef SUBWORLD_HAVOK
    {"havok", make_havok},
#endif
#ifdef SUBWORLD_PHYSX
    {"physx", make_physx},
#endif
};

}  // namespace

std::unique_ptr<Engine> make_engine(const EngineSettings& settings, std::span<const Mesh> meshes) {
  std::string known;
  for (const Maker& maker : kMakers) {
    if (maker.name == settings.name) return maker.make(settings, meshes);
    known += fmt::format("{}{}", known.empty() ? "" : ", ", maker.name);
  }
  throw Error(ExitCode::usage, fmt::format("engine \"{}\" is unknown; choose one of: {}", settings.name, known));
}

}  // namespace subworld
