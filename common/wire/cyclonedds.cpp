// The Cyclone DDS back end. Cyclone has no public way to send ready-made CDR bytes of a foreign type, so this file
// defines its own "sertype" and "serdata" with the library's internal interface. That interface belongs to one version:
#include <dds/version.h>
static_assert(DDS_VERSION_MAJOR == 0 && DDS_VERSION_MINOR == 10 && DDS_VERSION_PATCH == 2,
              "ddsi_sertype and ddsi_serdata are internal: compare them with 0.10.2 before another version is used");

#include "model/error.hpp"
#include "model/hash.hpp"
#include "wire/backend.hpp"

#include <fmt/format.h>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_keyhash.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>
#include <dds/ddsrt/md5.h>
#include <dds/ddsrt/mh3.h>

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <new>
#include <set>
#include <sstream>

namespace subworld::wire {
namespace {

constexpr std::int32_t kKeptForLateReaders = 64;  // of each key
constexpr std::size_t kPooledSamples = 256;
constexpr std::size_t kPooledBytes = 1U << 16U;

[[noreturn]] void fail(const std::string& message) { throw Error(ExitCode::middleware, "Cyclone DDS: " + message); }

dds_entity_t require(dds_entity_t entity, const std::string& what) {
  if (entity < 0) fail(fmt::format("no {}: {}", what, dds_strretcode(entity)));
  return entity;
}

// ---- Samples: bytes with a key in front

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

// ---- Endpoints

using QosPointer = std::unique_ptr<dds_qos_t, decltype([](dds_qos_t* qos) { dds_delete_qos(qos); })>;
using ListenerPointer =
    std::unique_ptr<dds_listener_t, decltype([](dds_listener_t* one) { dds_delete_listener(one); })>;

dds_duration_t nanoseconds(double seconds) { return static_cast<dds_duration_t>(std::llround(seconds * 1e9)); }

QosPointer make_qos(const Qos& from) {
  QosPointer qos(dds_create_qos());
  dds_qset_reliability(qos.get(), from.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       nanoseconds(from.max_blocking_s));
  dds_qset_durability(qos.get(), from.transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  const std::int32_t for_late_readers = from.keep_all ? kKeptForLateReaders : from.depth;
  dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, for_late_readers, DDS_LENGTH_UNLIMITED,
                              DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  dds_qset_history(qos.get(), from.keep_all ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST, from.depth);
  dds_qset_resource_limits(qos.get(), DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  if (from.deadline_s > 0.0) dds_qset_deadline(qos.get(), nanoseconds(from.deadline_s));
  dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, nanoseconds(from.lease_s));
  const dds_data_representation_id_t plain_cdr = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &plain_cdr);
  return qos;
}

class CycloneWriter final : public BackendWriter {
 public:
  CycloneWriter(dds_entity_t publisher, dds_entity_t topic, const EndpointSpec& spec, EventSink& events)
      : BackendWriter(spec.topic.name, events), publisher_(publisher) {
    writer_ = require(dds_create_writer(publisher, topic, make_qos(spec.qos).get(), listener().get()),
                      fmt::format("writer of {}", spec.topic.name));
  }
  ~CycloneWriter() override { dds_delete(publisher_); }

  bool write(std::span<const std::uint8_t> cdr) noexcept override { return dds_write(writer_, &cdr) == DDS_RETCODE_OK; }
  bool wait_for_acknowledgments(double timeout_s) noexcept override {
    return dds_wait_for_acks(writer_, nanoseconds(timeout_s)) == DDS_RETCODE_OK;
  }

 private:
  static CycloneWriter& of(void* self) { return *static_cast<CycloneWriter*>(self); }
  ListenerPointer listener() {
    ListenerPointer made(dds_create_listener(this));
    dds_listener_t* const to = made.get();
    dds_lset_publication_matched(to, [](dds_entity_t, auto status, void* self) { of(self).match(status); });
    dds_lset_offered_deadline_missed(to, [](dds_entity_t, auto status, void* self) { of(self).miss_deadline(status); });
    dds_lset_offered_incompatible_qos(to, [](dds_entity_t, auto status, void* self) { of(self).differ(status); });
    return made;
  }

  dds_entity_t publisher_;
  dds_entity_t writer_ = 0;
};

/// What discovery says of writers and their participants, also after they have gone.
class CyclonePeers {
 public:
  void open(dds_entity_t participant) {
    publications_ = require(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr),
                            "reader of publications");
    participants_ = require(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr),
                            "reader of participants");
  }

  /// 0: not known.
  [[nodiscard]] std::uint64_t participant_of(dds_instance_handle_t writer) const noexcept {
    std::uint64_t number = 0;
    look<dds_builtintopic_endpoint_t>(publications_, writer, [&](const auto& found) {
      number = kHashSeed;
      for (const std::uint8_t byte : found.participant_key.v) number = hashed(number, byte);
    });
    return number;
  }

  [[nodiscard]] std::string program_of(dds_instance_handle_t writer) const {
    std::string text;
    look<dds_builtintopic_endpoint_t>(publications_, writer, [&](const auto& of) {
      look<dds_builtintopic_participant_t>(participants_, of.participant_instance_handle,
                                           [&](const auto& found) { text = describe(found.qos); });
    });
    return text;
  }

 private:
  template <class T, class Use>
  static void look(dds_entity_t reader, dds_instance_handle_t instance, Use use) {
    void* sample = nullptr;
    dds_sample_info_t info;
    if (instance == 0 || dds_read_instance(reader, &sample, &info, 1, 1, instance) != 1) return;
    use(*static_cast<const T*>(sample));
    dds_return_loan(reader, &sample, 1);
  }

  static std::string describe(const dds_qos_t* qos) {
    char* name = nullptr;
    std::string text;
    if (dds_qget_entity_name(qos, &name) && name != nullptr) text = name;
    dds_free(name);
    return program_text(text, property(qos, kProcessProperties), property(qos, kHostProperties));
  }

  template <class Names>
  static std::string property(const dds_qos_t* qos, const Names& names) {
    std::string text;
    for (const char* name : names) {
      char* value = nullptr;
      if (dds_qget_prop(qos, name, &value) && value != nullptr) text = value;
      dds_free(value);
    }
    return text.substr(0, text.find(':'));
  }

  dds_entity_t publications_ = 0;
  dds_entity_t participants_ = 0;
};

class CycloneReader final : public HoldingReader {
 public:
  CycloneReader(dds_entity_t subscriber, dds_entity_t topic, const EndpointSpec& spec, const CyclonePeers& peers,
                EventSink& events)
      : HoldingReader(spec, events), subscriber_(subscriber), peers_(peers) {
    reader_ = require(dds_create_reader(subscriber, topic, make_qos(spec.qos).get(), listener().get()),
                      fmt::format("reader of {}", spec.topic.name));
  }
  ~CycloneReader() override { dds_delete(subscriber_); }

  [[nodiscard]] std::uint64_t participant_of(std::uint64_t writer) const noexcept override {
    return peers_.participant_of(writer);
  }
  [[nodiscard]] std::string program_of(std::uint64_t writer) const override { return peers_.program_of(writer); }

 private:
  static CycloneReader& of(void* self) { return *static_cast<CycloneReader*>(self); }
  void hold(dds_entity_t reader) noexcept {
    drain([&](std::vector<std::uint8_t>& cdr, std::uint64_t& writer) {
      void* room = &cdr;
      dds_sample_info_t info;
      while (dds_take(reader, &room, &info, 1, 1) == 1) {
        writer = info.publication_handle;
        if (info.valid_data) return true;
      }
      return false;
    });
  }
  ListenerPointer listener() {
    ListenerPointer made(dds_create_listener(this));
    dds_listener_t* const to = made.get();
    dds_lset_data_available(to, [](dds_entity_t reader, void* self) { of(self).hold(reader); });
    dds_lset_subscription_matched(to, [](dds_entity_t, auto status, void* self) {
      of(self).match(status);
      if (status.current_count_change < 0) of(self).bury(status.last_publication_handle);
    });
    dds_lset_requested_deadline_missed(to,
                                       [](dds_entity_t, auto status, void* self) { of(self).miss_deadline(status); });
    dds_lset_requested_incompatible_qos(to, [](dds_entity_t, auto status, void* self) { of(self).differ(status); });
    dds_lset_liveliness_changed(to, [](dds_entity_t, auto status, void* self) {
      of(self).change_liveliness(status);
      if (status.alive_count_change < 0) of(self).bury(status.last_publication_handle);
    });
    dds_lset_sample_lost(to, [](dds_entity_t, auto status, void* self) { of(self).lose(status); });
    dds_lset_sample_rejected(to, [](dds_entity_t, auto status, void* self) { of(self).reject(status); });
    return made;
  }

  dds_entity_t subscriber_;
  const CyclonePeers& peers_;
  dds_entity_t reader_ = 0;
};

// ---- Participant

/// Defaults, which the settings file may override: unicast, whole-datagram messages, quick repair of losses, no
/// throttling. Without adaptation the initial mark is the one that counts: 30 kB by default, beyond which a reader that
/// was killed blocks its writers until its lease has expired.
constexpr const char* kDefaults = R"(<CycloneDDS><Domain Id="any">
<General><AllowMulticast>false</AllowMulticast><MaxMessageSize>{0}B</MaxMessageSize><FragmentSize>65000B</FragmentSize></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{1}</MaxAutoParticipantIndex>
<LeaseDuration>10s</LeaseDuration><SPDPInterval>1s</SPDPInterval></Discovery>
<Internal><HeartbeatInterval min="1ms" minsched="5ms" max="100ms">20ms</HeartbeatInterval>
<GenerateKeyhash>true</GenerateKeyhash><NackDelay>1ms</NackDelay><WriterLingerDuration>100ms</WriterLingerDuration>
<Watermarks><WhcAdaptive>false</WhcAdaptive><WhcHighInit>256MB</WhcHighInit><WhcHigh>256MB</WhcHigh></Watermarks></Internal>
</Domain></CycloneDDS>)";

std::string read_file(const std::string& name) {
  std::ifstream file(name);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// `text` without the sections from `begin` to `end`, both included.
void erase_parts(std::string& text, const std::string& begin, const std::string& end) {
  for (std::size_t from = text.find(begin); from != std::string::npos; from = text.find(begin)) {
    const std::size_t to = text.find(end, from);
    if (to == std::string::npos) return;
    text.erase(from, to + end.size() - from);
  }
}

/// Captures the log, where alone the library states why it refused the settings.
class LogCapture {
 public:
  LogCapture() {
    dds_set_log_sink(
        [](void* to, const dds_log_data_t* line) {
          auto& text = *static_cast<std::string*>(to);
          text += text.empty() ? "" : "; ";
          text += std::string_view(line->message).substr(0, std::string_view(line->message).find('\n'));
        },
        &text_);
  }
  ~LogCapture() { dds_set_log_sink(nullptr, nullptr); }
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class CycloneBackend final : public Backend {
 public:
  CycloneBackend(const Opening& opening, EventSink& events) : events_(events) {
    const std::string settings = make_settings(opening);
    open_domain(opening, settings);
    try {
      QosPointer qos(dds_create_qos());
      dds_qset_entity_name(qos.get(), opening.participant_name.c_str());
      participant_ = require(dds_create_participant(id_, qos.get(), nullptr), "participant");
      peers_.open(participant_);
    } catch (...) {
      close();
      throw;
    }
  }

  ~CycloneBackend() override { close(); }

  std::unique_ptr<BackendWriter> create_writer(const EndpointSpec& spec) override {
    const dds_entity_t publisher =
        require(dds_create_publisher(participant_, partition(spec).get(), nullptr), "publisher");
    return std::make_unique<CycloneWriter>(publisher, topic(spec.topic), spec, events_);
  }

  std::unique_ptr<BackendReader> create_reader(const EndpointSpec& spec) override {
    const dds_entity_t subscriber =
        require(dds_create_subscriber(participant_, partition(spec).get(), nullptr), "subscriber");
    return std::make_unique<CycloneReader>(subscriber, topic(spec.topic), spec, peers_, spec.events_or(events_));
  }

 private:
  static QosPointer partition(const EndpointSpec& spec) {
    QosPointer qos(dds_create_qos());
    const char* name = spec.partition.c_str();
    if (*name != '\0') dds_qset_partition(qos.get(), 1, &name);
    return qos;
  }

  dds_entity_t topic(const TopicSpec& spec) {
    dds_entity_t& topic = topics_[spec.name];
    if (topic == 0) {
      auto* type = new Sertype;
      std::memset(static_cast<ddsi_sertype*>(type), 0, sizeof(ddsi_sertype));
      type->topic = spec;
      ddsi_sertype_init(type, spec.type, &kSertypeOps, &kSerdataOps, spec.key_words == 0);
      ddsi_sertype* handed_over = type;
      const dds_entity_t created =
          dds_create_topic_sertype(participant_, spec.name, &handed_over, nullptr, nullptr, nullptr);
      if (created < 0) ddsi_sertype_unref(type);
      topic = require(created, fmt::format("topic {} of type {}", spec.name, spec.type));
    }
    return topic;
  }

  /// Later sections of the list override earlier ones, but lists of interfaces and peers are merged. Therefore each
  /// appears once.
  std::string make_settings(const Opening& opening) {
    std::string user = opening.settings_file;
    if (!user.empty() && user.find('<') == std::string::npos && user.find(',') == std::string::npos) {
      constexpr std::string_view kScheme = "file://";
      user = read_file(user.starts_with(kScheme) ? user.substr(kScheme.size()) : user);
      if (user.empty()) fail(fmt::format("{}: empty or not readable", opening.settings_file));
    }
    erase_parts(user, "<?", "?>");
    erase_parts(user, "<!--", "-->");
    if (!opening.interface_address.empty()) erase_parts(user, "<Interfaces", "</Interfaces>");
    if (!opening.peers.empty()) erase_parts(user, "<Peers", "</Peers>");
    const Route route(opening, user.find("<NetworkInterface") != std::string::npos,
                      user.find("<Peer ") != std::string::npos);
    std::string network;
    if (!route.address.empty()) {
      network =
          fmt::format("<General><Interfaces><NetworkInterface address=\"{}\"/></Interfaces></General>", route.address);
    }
    if (route.peers && !route.peers->empty()) {
      network += "<Discovery><Peers>";
      for (const std::string& peer : *route.peers) network += fmt::format("<Peer Address=\"{}\"/>", peer);
      network += "</Peers></Discovery>";
    }
    route_ = route.text();
    return fmt::format("{},{}{}<CycloneDDS><Domain Id=\"any\">{}</Domain></CycloneDDS>",
                       fmt::format(fmt::runtime(kDefaults), kMessageBytes, opening.participants - 1), user,
                       user.empty() ? "" : ",", network);
  }

  /// Cyclone allows one domain of a number in a process. A second bus gets another internal number and the same
  /// external one.
  void open_domain(const Opening& opening, const std::string& settings) {
    const std::lock_guard lock(domains_mutex);
    id_ = static_cast<dds_domainid_t>(opening.domain);
    while (domains.contains(id_)) id_ += 1000;
    std::string all = settings;
    if (id_ != static_cast<dds_domainid_t>(opening.domain)) {
      all += fmt::format(
          ",<CycloneDDS><Domain Id=\"any\"><Discovery><ExternalDomainId>{}</ExternalDomainId></Discovery>"
          "</Domain></CycloneDDS>",
          opening.domain);
    }
    const LogCapture log;
    domain_ = dds_create_domain(id_, all.c_str());
    if (domain_ < 0) {
      fail(
          fmt::format("domain {} ({}{}{}) was refused: {}; correct the settings, or look for programs "
                      "that still run if no participant index is free",
                      opening.domain, route_, opening.settings_file.empty() ? "" : " settings=", opening.settings_file,
                      log.text().empty() ? dds_strretcode(domain_) : log.text()));
    }
    domains.insert(id_);
  }

  void close() noexcept {
    dds_delete(domain_);
    const std::lock_guard lock(domains_mutex);
    domains.erase(id_);
  }

  static inline std::mutex domains_mutex;
  static inline std::set<dds_domainid_t> domains;  ///< open in this process

  EventSink& events_;
  dds_domainid_t id_ = 0;
  dds_entity_t domain_ = 0;
  dds_entity_t participant_ = 0;
  CyclonePeers peers_;
  std::map<std::string, dds_entity_t> topics_;
};

}  // namespace
}  // namespace subworld::wire

extern "C" subworld::wire::Backend* subworld_open_backend(const subworld::wire::Opening& opening,
                                                          subworld::wire::EventSink& events) {
  return new subworld::wire::CycloneBackend(opening, events);
}
extern "C" const char* subworld_backend_version() { return DDS_VERSION; }
