#pragma once

#include "haptic_sim/local_model.hpp"

#include <cstddef>
#include <memory>

namespace subworld {

/// A copy of the neighbourhood of a user's proxy in an engine of its own, with the outside at its border.
[[nodiscard]] std::unique_ptr<LocalModel> make_neighbourhood(const Scheme& scheme, const Scene& scene,
                                                             std::size_t user);

}  // namespace subworld
