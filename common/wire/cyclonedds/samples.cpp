// Cyclone has no public way to send ready-made CDR bytes of a foreign type, so this file defines its own "sertype" and
// "serdata" with the library's internal interface. That interface belongs to one version:
#include <dds/version.h>
static_assert(DDS_VERSION_MAJOR == 0 && DDS_VERSION_MINOR == 10 && DDS_VERSION_PATCH >= 2 && DDS_VERSION_PATCH <= 5,
              "ddsi_sertype and ddsi_serdata are internal: compare them with 0.10.2 before another version is used");

#include "wire/cyclonedds/samples.hpp"

#include <dds/ddsi/ddsi_keyhash.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>
#include <dds/ddsrt/md5.h>
#include <dds/ddsrt/mh3.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <new>
#include <span>
#include <vector>

namespace subworld::wire::cyclone {
namespace {

constexpr std::size_t kPooledSamples = 256;
constexpr std::size_t kPooledBytes = 1U << 16U;

struct Sertype : ddsi_sertype {
  TopicSpec topic{};
};

struct Serdata : ddsi_serdata {
  std::array<std::uint8_t, 16> key{};  // big-endian, zeros behind
  std::vector<std::uint8_t> bytes;     // header included, a multiple of 4
};

/// Samples are created and freed at haptic rates on any thread, so their memory is reused.
class Pool {
 public:
  Pool() { free_.reserve(kPooledSamples); }

  Serdata* get() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return new Serdata;
    Serdata* sample = free_.back();
    free_.pop_back();
    return sample;
  }

  void put(Serdata* sample) noexcept {
    {
      const std::lock_guard lock(mutex_);
      if (free_.size() < kPooledSamples && sample->bytes.capacity() <= kPooledBytes) {
        free_.push_back(sample);
        return;
      }
    }
    delete sample;
  }

 private:
  std::mutex mutex_;
  std::vector<Serdata*> free_;
};

/// Lives as long as the process, because Cyclone's threads may free samples late.
Pool& pool() {
  static Pool* const instance = new Pool;
  return *instance;
}

const Serdata& self(const ddsi_serdata* data) { return *static_cast<const Serdata*>(data); }

Serdata* new_sample(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size) {
  Serdata* sample = pool().get();
  ddsi_serdata_init(sample, type, kind);
  sample->key.fill(0);
  sample->bytes.resize((size + 3) & ~std::size_t{3});
  std::fill(sample->bytes.begin() + static_cast<std::ptrdiff_t>(size), sample->bytes.end(), std::uint8_t{0});
  return sample;
}

void set_hash(Serdata& sample) {
  sample.hash = ddsrt_mh3(sample.key.data(), sample.key.size(), 0) ^ sample.type->serdata_basehash;
}

/// Reads the key from the bytes. If they are too short, returns the sample to the pool and returns null. All keys that
/// no program has count as one, for which the library reserves room once.
ddsi_serdata* finish(Serdata* sample) {
  const auto* type = static_cast<const Sertype*>(sample->type);
  const std::uint32_t key_bytes = 4 * type->topic.key_words;
  if (sample->bytes.size() < kHeaderBytes + key_bytes) {
    pool().put(sample);
    return nullptr;
  }
  const bool little = (sample->bytes[1] & 1) != 0;
  for (std::uint32_t i = 0; i < key_bytes; ++i) {
    sample->key[i] = sample->bytes[kHeaderBytes + (little ? (i ^ 3U) : i)];
  }
  if (!is_known_key(type->topic, sample->bytes)) sample->key.fill(0xff);
  set_hash(*sample);
  return sample;
}

bool equal_keys(const ddsi_serdata* a, const ddsi_serdata* b) { return self(a).key == self(b).key; }
std::uint32_t size_of(const ddsi_serdata* data) { return static_cast<std::uint32_t>(self(data).bytes.size()); }

/// A sample whose `size` bytes `fill` writes; null if memory ran out.
template <class Fill>
ddsi_serdata* make_sample(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size, Fill fill) noexcept try {
  Serdata* sample = new_sample(type, kind, size);
  fill(sample->bytes.data());
  return finish(sample);
} catch (const std::bad_alloc&) {
  return nullptr;
}

ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment,
                             std::size_t size) {
  return make_sample(type, kind, size, [&](std::uint8_t* bytes) {
    std::size_t filled = 0;
    for (; fragment != nullptr; fragment = fragment->nextfrag) {
      if (fragment->maxp1 <= filled || fragment->min > filled || fragment->maxp1 > size) continue;
      const unsigned char* payload = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
      std::memcpy(bytes + filled, payload + (filled - fragment->min), fragment->maxp1 - filled);
      filled = fragment->maxp1;
    }
  });
}

ddsi_serdata* from_pieces(const ddsi_sertype* type, ddsi_serdata_kind kind, ddsrt_msg_iovlen_t count,
                          const ddsrt_iovec_t* pieces, std::size_t size) {
  return make_sample(type, kind, size, [&](std::uint8_t* bytes) {
    std::size_t filled = 0;
    for (ddsrt_msg_iovlen_t i = 0; i < count && filled < size; ++i) {
      const std::size_t part = std::min<std::size_t>(pieces[i].iov_len, size - filled);
      std::memcpy(bytes + filled, pieces[i].iov_base, part);
      filled += part;
    }
  });
}

ddsi_serdata* from_key_hash(const ddsi_sertype* type, const ddsi_keyhash* hash) {
  const std::uint32_t key_bytes = 4 * static_cast<const Sertype*>(type)->topic.key_words;
  return make_sample(type, SDK_KEY, kHeaderBytes + key_bytes, [&](std::uint8_t* bytes) {
    std::memset(bytes, 0, kHeaderBytes);  // CDR, big-endian as the hash
    std::memcpy(bytes + kHeaderBytes, hash->value, key_bytes);
  });
}

/// Argument of `dds_write`: the encoded bytes.
ddsi_serdata* from_sample(const ddsi_sertype* type, ddsi_serdata_kind kind, const void* data) {
  const auto& cdr = *static_cast<const std::span<const std::uint8_t>*>(data);
  return make_sample(type, kind, cdr.size(), [&](std::uint8_t* bytes) { std::memcpy(bytes, cdr.data(), cdr.size()); });
}

void to_bytes(const ddsi_serdata* data, std::size_t offset, std::size_t size, void* buffer) {
  std::memcpy(buffer, self(data).bytes.data() + offset, size);
}

ddsi_serdata* to_reference(const ddsi_serdata* data, std::size_t offset, std::size_t size, ddsrt_iovec_t* piece) {
  piece->iov_base = const_cast<std::uint8_t*>(self(data).bytes.data() + offset);
  piece->iov_len = size;
  return ddsi_serdata_ref(data);
}

void drop_reference(ddsi_serdata* data, const ddsrt_iovec_t*) { ddsi_serdata_unref(data); }

/// Argument of `dds_take`: a buffer for the encoded bytes.
bool to_sample(const ddsi_serdata* data, void* sample, void**, void*) try {
  *static_cast<std::vector<std::uint8_t>*>(sample) = self(data).bytes;
  return true;
} catch (const std::bad_alloc&) {
  return false;
}

bool key_to_sample(const ddsi_sertype*, const ddsi_serdata*, void* sample, void**, void*) {
  static_cast<std::vector<std::uint8_t>*>(sample)->clear();
  return true;
}

ddsi_serdata* to_untyped(const ddsi_serdata* data) {
  Serdata* sample = new_sample(data->type, SDK_KEY, 0);
  sample->key = self(data).key;
  set_hash(*sample);
  sample->type = nullptr;
  return sample;
}

void free_sample(ddsi_serdata* data) { pool().put(static_cast<Serdata*>(data)); }

std::size_t print(const ddsi_sertype*, const ddsi_serdata* data, char* buffer, std::size_t size) {
  return static_cast<std::size_t>(std::snprintf(buffer, size, "%zu bytes", self(data).bytes.size()));
}

void key_hash(const ddsi_serdata* data, ddsi_keyhash* hash, bool force_md5) {
  const auto& key = self(data).key;
  if (!force_md5) {
    std::memcpy(hash->value, key.data(), key.size());
    return;
  }
  const auto* type = static_cast<const Sertype*>(data->type);
  ddsrt_md5_state_t state;
  ddsrt_md5_init(&state);
  ddsrt_md5_append(&state, key.data(), type == nullptr ? 0 : 4 * type->topic.key_words);
  ddsrt_md5_finish(&state, hash->value);
}

const ddsi_serdata_ops kSerdataOps = [] {
  ddsi_serdata_ops ops{};
  ops.eqkey = equal_keys;
  ops.get_size = size_of;
  ops.from_ser = from_fragments;
  ops.from_ser_iov = from_pieces;
  ops.from_keyhash = from_key_hash;
  ops.from_sample = from_sample;
  ops.to_ser = to_bytes;
  ops.to_ser_ref = to_reference;
  ops.to_ser_unref = drop_reference;
  ops.to_sample = to_sample;
  ops.to_untyped = to_untyped;
  ops.untyped_to_sample = key_to_sample;
  ops.free = free_sample;
  ops.print = print;
  ops.get_keyhash = key_hash;
  return ops;
}();

// Samples are never loaned, so the type never allocates or frees any. Without type_id, type_map and derive_sertype,
// types match by name, as in Fast DDS.
const ddsi_sertype_ops kSertypeOps = [] {
  ddsi_sertype_ops ops{};
  ops.version = ddsi_sertype_v0;
  ops.free = [](ddsi_sertype* type) {
    ddsi_sertype_fini(type);
    delete static_cast<Sertype*>(type);
  };
  ops.zero_samples = [](const ddsi_sertype*, void*, size_t) {};
  ops.realloc_samples = [](void** out, const ddsi_sertype*, void*, size_t, size_t) { *out = nullptr; };
  ops.free_samples = [](const ddsi_sertype*, void**, size_t, dds_free_op_t) {};
  ops.equal = [](const ddsi_sertype* a, const ddsi_sertype* b) {
    return static_cast<const Sertype*>(a)->topic.key_words == static_cast<const Sertype*>(b)->topic.key_words;
  };
  ops.hash = [](const ddsi_sertype* type) { return static_cast<const Sertype*>(type)->topic.key_words; };
  return ops;
}();

}  // namespace

dds_entity_t create_topic(dds_entity_t participant, const TopicSpec& spec) {
  auto* type = new Sertype;
  std::memset(static_cast<ddsi_sertype*>(type), 0, sizeof(ddsi_sertype));
  type->topic = spec;
  ddsi_sertype_init(type, spec.type, &kSertypeOps, &kSerdataOps, spec.key_words == 0);
  ddsi_sertype* handed_over = type;
  const dds_entity_t created =
      dds_create_topic_sertype(participant, spec.name, &handed_over, nullptr, nullptr, nullptr);
  if (created < 0) ddsi_sertype_unref(type);
  return require(created, fmt::format("topic {} of type {}", spec.name, spec.type));
}

}  // namespace subworld::wire::cyclone
