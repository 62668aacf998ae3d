#pragma once

#include "coupling/schemes/scheme.hpp"

namespace subworld::test {

/// The smallest scheme with a sub-world: nothing represents the outside at its border, the mean device force acts on
/// the world's proxy, and the two copies of each body meet half way. To add a scheme is this folder and one row, here
/// `add_scheme(kExampleScheme)`.
extern const Scheme kExampleScheme;

}  // namespace subworld::test
