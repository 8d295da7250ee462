#include "tileflight/live/ros2/participant.h"

#include <dds/dds.h>
#include <dds/ddsrt/log.h>

#include <algorithm>
#include <cctype>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/cdr.h"
#include "tileflight/live/ros2/entities.h"

// Definition: https://github.com/ros2/rmw_dds_common, msg/ParticipantEntitiesInfo.msg, NodeEntitiesInfo.msg, Gid.msg.
// Elements: https://github.com/eclipse-cyclonedds/cyclonedds/blob/releases/0.10.x/docs/manual/options.md

namespace tileflight::ros2 {
namespace {

std::string domain(const std::string& elements) {
  return "<CycloneDDS><Domain Id=\"any\">" + elements + "</Domain></CycloneDDS>";
}

/// Writers keep the last few messages also of those that are not acknowledged, so that their number is the limit; the
/// high-water mark would stop all readers' messages for the slowest one.
const char* const kLimits =
    "<Internal><Watermarks><WhcHigh>1 GB</WhcHigh><WhcHighInit>1 GB</WhcHighInit></Watermarks>"
    "<MaxSampleSize>256 MB</MaxSampleSize></Internal>";

/// Loopback has no multicast: others are found by messages to the ports that they may have. The messages are frequent,
/// since a new participant has missed the earlier ones. Large datagrams are cheap, as no part is lost; the MTU of
/// loopback is 64 KiB.
const char* const kLoopback =
    "<General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces><AllowMulticast>false</AllowMulticast>"
    "<MaxMessageSize>65000 B</MaxMessageSize><FragmentSize>60000 B</FragmentSize></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>"
    "<SPDPInterval>1 s</SPDPInterval><Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>";

const char* const kNoSharedMemory = "<SharedMemory><Enable>false</Enable></SharedMemory>";

bool is_address(const std::string& name) {
  return name.find_first_not_of("0123456789.") == std::string::npos || name.find(':') != std::string::npos;
}

std::string interface_elements(const std::string& name) {
  const bool is_valid = name.size() < 64 && std::ranges::all_of(name, [](char c) {
                          return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                                 std::string_view("._-:@").find(c) != std::string_view::npos;
                        });
  if (!is_valid)
    throw InputError("--ros2-interface",
                     "'" + name.substr(0, 100) + "' is no name or address of an interface (see `ip address`)");
  const std::string key = is_address(name) ? "address" : "name";
  return "<General><Interfaces><NetworkInterface " + key + "=\"" + name + "\"/></Interfaces></General>";
}

}  // namespace

/// Later parts take precedence.
std::string configuration(const std::string& interface_name, const std::string& cyclonedds_uri) {
  std::string parts = domain(kLimits) + ",";
  if (!interface_name.empty()) {
    parts += domain(interface_elements(interface_name));
  } else {
    parts += cyclonedds_uri.empty() ? domain(kLoopback) : cyclonedds_uri;
  }
  return parts + "," + domain(kNoSharedMemory);
}

namespace {

using messages::CdrWriter;

/// The identifier's octets; the rest are zeros.
void put(CdrWriter& writer, Release release, const Guid& guid) {
  writer.array(guid);
  constexpr std::array<std::uint8_t, 8> kRest{};
  if (release == Release::kHumble) writer.array(kRest);
}

void put(CdrWriter& writer, Release release, const std::set<Guid>& guids) {
  writer.number(static_cast<std::uint32_t>(guids.size()));
  for (const Guid& guid : guids) put(writer, release, guid);
}

}  // namespace

std::string participant_entities_info(Release release, const Guid& participant, const NodeInfo& node) {
  CdrWriter writer;
  put(writer, release, participant);
  writer.number(std::uint32_t{1}).text(node.node_namespace).text(node.name);
  put(writer, release, node.readers);
  put(writer, release, node.writers);
  return writer.bytes();
}

namespace {

constexpr std::size_t kMaxLines = 100, kMaxLineBytes = 400;

std::string cyclonedds_uri() {
  const char* text = std::getenv("CYCLONEDDS_URI");
  return text == nullptr ? "" : text;
}

Guid guid_of(dds_entity_t entity) {
  dds_guid_t guid{};
  dds_get_guid(entity, &guid);
  Guid octets{};
  std::memcpy(octets.data(), guid.v, octets.size());
  return octets;
}

/// Each line once, and no end of lines neither: peers could make them.
class Lines {
 public:
  explicit Lines(Participant::Log log) : log_(std::move(log)) {}

  void add(const std::string& line) { add(line, line); }
  /// Not if there was one with this key.
  void add(std::string line, const std::string& key) {
    const std::lock_guard lock(mutex_);
    if (line.size() > kMaxLineBytes) line = line.substr(0, kMaxLineBytes) + "…";
    if (shown_.size() >= kMaxLines || !shown_.insert(key.substr(0, kMaxLineBytes)).second) return;
    last_ = line;
    if (is_open_) {
      show(line);
    } else {
      before_.push_back(line);
    }
    if (shown_.size() == kMaxLines) show("further lines are not shown");
  }
  /// Shows what was said so far: where joining fails, the error says it.
  void open() {
    const std::lock_guard lock(mutex_);
    is_open_ = true;
    for (const std::string& line : std::exchange(before_, {})) show(line);
  }
  std::string last() const {
    const std::lock_guard lock(mutex_);
    return last_;
  }

  /// A line of CycloneDDS. Its warnings are of malformed and oversize messages, lost sockets, and the like, with
  /// numbers and bytes that senders can vary: each kind is shown once.
  static void write(void* lines, const dds_log_data_t* data) {
    std::string text(data->message, data->size);
    while (!text.empty() && text.back() == '\n') text.pop_back();
    const std::string kind = text.substr(0, text.find_first_of("0123456789(<"));
    static_cast<Lines*>(lines)->add("CycloneDDS: " + text.substr(0, text.find(" <")), "CycloneDDS: " + kind);
  }

 private:
  void show(const std::string& line) const {
    if (log_) log_("ROS 2: " + line);
  }

  Participant::Log log_;
  mutable std::mutex mutex_;  ///< guards the members below
  bool is_open_ = false;
  std::vector<std::string> before_;
  std::set<std::string> shown_;
  std::string last_;
};

}  // namespace

struct Participant::Impl {
  Impl(const ParticipantOptions& wanted, Log log)
      : options(wanted), uri(wanted.interface_name.empty() ? cyclonedds_uri() : ""), lines(std::move(log)) {
    node.name = options.node;
    dds_set_log_sink(&Lines::write, &lines);
  }
  ~Impl() {
    if (domain > 0) dds_delete(domain);
    dds_set_log_sink(nullptr, nullptr);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void open();
  dds_entity_t checked(dds_entity_t entity) const;
  void add_or_remove(Kind kind, dds_entity_t entity, bool is_added);
  void tell_others();

  ParticipantOptions options;
  std::string uri;
  Lines lines;
  dds_entity_t domain = 0, participant = 0;
  std::mutex node_mutex;  ///< guards the next two
  NodeInfo node;
  std::unique_ptr<Entity> discovery;
  mutable std::mutex audience_mutex;  ///< guards the next two; taken by DDS's own threads
  std::int64_t readers = 0;
  std::uint64_t changes = 0;
  mutable std::condition_variable_any readers_came;
};

dds_entity_t Participant::Impl::checked(dds_entity_t entity) const {
  if (entity >= 0) return entity;
  const std::string where = !options.interface_name.empty() ? "--ros2-interface '" + options.interface_name + "'"
                            : !uri.empty()                  ? "CYCLONEDDS_URI"
                                                            : "ROS 2 domain " + std::to_string(options.domain);
  const std::string cause = lines.last();
  throw InputError(where, std::string("cannot be used: ") + (cause.empty() ? dds_strretcode(-entity) : cause));
}

/// "enclave" is what marks a participant as ROS 2's.
void Participant::Impl::open() {
  domain = checked(dds_create_domain(options.domain, configuration(options.interface_name, uri).c_str()));
  const std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> qos(dds_create_qos(), dds_delete_qos);
  const std::string user_data = "enclave=/;";
  dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  participant = checked(dds_create_participant(options.domain, qos.get(), nullptr));
  lines.open();
}

void Participant::Impl::add_or_remove(Kind kind, dds_entity_t entity, bool is_added) {
  const Guid guid = guid_of(entity);
  const std::lock_guard lock(node_mutex);
  if (!discovery) return;  // its own entity
  std::set<Guid>& entities = kind == Kind::kReader ? node.readers : node.writers;
  if (is_added) {
    entities.insert(guid);
  } else {
    entities.erase(guid);
  }
  tell_others();
}

void Participant::Impl::tell_others() {
  discovery->write(participant_entities_info(options.release, guid_of(participant), node));
}

Participant::Participant(const ParticipantOptions& options, Log log)
    : impl_(std::make_unique<Impl>(options, std::move(log))) {
  impl_->open();
  Entity::Options discovery{kDiscoveryTopic, kDiscoveryType, {.is_latched = true, .depth = 1}, {}};
  auto entity = std::make_unique<Entity>(*this, Kind::kWriter, discovery, nullptr);
  const std::lock_guard lock(impl_->node_mutex);
  impl_->discovery = std::move(entity);
  impl_->tell_others();
}

Participant::~Participant() {
  std::unique_ptr<Entity> last;
  const std::lock_guard lock(impl_->node_mutex);
  last = std::move(impl_->discovery);
}

std::string Participant::network() const {
  if (!impl_->options.interface_name.empty()) return impl_->options.interface_name;
  return impl_->uri.empty() ? "127.0.0.1 alone" : "CYCLONEDDS_URI";
}

std::uint64_t Participant::audience_changes() const {
  const std::lock_guard lock(impl_->audience_mutex);
  return impl_->changes;
}

bool Participant::wait_for_reader(const std::stop_token& stop) const {
  std::unique_lock lock(impl_->audience_mutex);
  return impl_->readers_came.wait(lock, stop, [this] { return impl_->readers > 0; }) && !stop.stop_requested();
}

std::int32_t Participant::handle() const { return impl_->participant; }

void Participant::add(Kind kind, std::int32_t entity) { impl_->add_or_remove(kind, entity, true); }

void Participant::remove(Kind kind, std::int32_t entity) { impl_->add_or_remove(kind, entity, false); }

void Participant::count_readers(std::int32_t change) {
  {
    const std::lock_guard lock(impl_->audience_mutex);
    impl_->readers += change;
    ++impl_->changes;
  }
  impl_->readers_came.notify_all();
}

void Participant::report(const std::string& line) { impl_->lines.add(line); }

}  // namespace tileflight::ros2
