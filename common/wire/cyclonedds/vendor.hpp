#pragma once

#include "model/error.hpp"

#include <fmt/core.h>

#include <dds/dds.h>

#include <string>

namespace subworld::wire::cyclone {

[[noreturn]] inline void fail(const std::string& message) {
  throw Error(ExitCode::middleware, "Cyclone DDS: " + message);
}

inline dds_entity_t require(dds_entity_t entity, const std::string& what) {
  if (entity < 0) fail(fmt::format("no {}: {}", what, dds_strretcode(entity)));
  return entity;
}

}  // namespace subworld::wire::cyclone
