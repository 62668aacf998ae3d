#pragma once

#include "wire/bus.hpp"

namespace subworld {

/// Takes a reader's oldest sample and marks the loop's stages (rt/stages): `receiving` until the bytes are received,
/// and `decode`.
template <class From, class M, class Stages>
Take take(From& reader, M& sample, Stages& stages, typename Stages::Stage receiving = Stages::Stage::receive) {
  const bool came = reader.receive();
  stages.mark(receiving);
  if (!came) return Take::none;
  const bool sound = reader.decode(sample);
  stages.mark(Stages::Stage::decode);
  return sound ? Take::sample : Take::rejected;
}

}  // namespace subworld
