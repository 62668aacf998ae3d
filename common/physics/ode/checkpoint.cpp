#include "checkpoint.hpp"

#include "model/error.hpp"

#include <cstring>

namespace subworld::ode {

namespace {

struct Header {
  std::array<char, 8> engine;
  std::uint64_t bodies, frictions;
};
constexpr std::array<char, 8> kMark{'o', 'd', 'e', '0', '.', '1', '6', 0};

}  // namespace

void refuse_checkpoint() {
  throw Error(ExitCode::failed, "the checkpoint is of another engine or of other bodies; take one from this engine");
}

Checkpoint pack(const Saved& saved) {
  const Header header{kMark, saved.bodies.size(), saved.frictions.size()};
  const std::size_t bodies = saved.bodies.size() * sizeof(SavedBody);
  const std::size_t frictions = saved.frictions.size() * sizeof(Friction);
  Checkpoint checkpoint;
  checkpoint.bytes.resize(sizeof header + bodies + frictions);
  std::byte* to = checkpoint.bytes.data();
  std::memcpy(to, &header, sizeof header);
  if (bodies > 0) std::memcpy(to + sizeof header, saved.bodies.data(), bodies);
  if (frictions > 0) std::memcpy(to + sizeof header + bodies, saved.frictions.data(), frictions);
  return checkpoint;
}

Saved unpack(const Checkpoint& checkpoint) {
  const std::size_t size = checkpoint.bytes.size();
  Header header;
  if (size < sizeof header) refuse_checkpoint();
  const std::byte* from = checkpoint.bytes.data();
  std::memcpy(&header, from, sizeof header);
  if (header.engine != kMark || header.bodies > size || header.frictions > size ||
      size != sizeof header + header.bodies * sizeof(SavedBody) + header.frictions * sizeof(Friction)) {
    refuse_checkpoint();
  }
  Saved saved;
  saved.bodies.resize(header.bodies);
  saved.frictions.resize(header.frictions);
  const std::size_t bodies = header.bodies * sizeof(SavedBody);
  if (header.bodies > 0) std::memcpy(saved.bodies.data(), from + sizeof header, bodies);
  if (header.frictions > 0) {
    std::memcpy(saved.frictions.data(), from + sizeof header + bodies, header.frictions * sizeof(Friction));
  }
  return saved;
}

}  // namespace subworld::ode
