#pragma once

#include "wire/backend.hpp"
#include "wire/cyclonedds/vendor.hpp"

namespace subworld::wire::cyclone {

/// A topic whose samples are encoded bytes with the key in front. `dds_write` takes a `std::span<const std::uint8_t>`
/// of it, `dds_take` a `std::vector<std::uint8_t>`. Throws `Error` (middleware).
[[nodiscard]] dds_entity_t create_topic(dds_entity_t participant, const TopicSpec& spec);

}  // namespace subworld::wire::cyclone
