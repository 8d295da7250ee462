// A participant of a DDS domain by eProsima Fast DDS, for tests of what tileflight says to ROS 2: it finds topics,
// reads and writes messages as raw CDR, and calls services as rmw_cyclonedds_cpp's clients do.
//
//   fast_dds_peer DOMAIN discover SECONDS
//   fast_dds_peer DOMAIN read FOLDER SECONDS {TOPIC TYPE reliable|best_effort volatile|latched COUNT}...
//     (until so many have come, all writers have gone, or the time is over)
//   fast_dds_peer DOMAIN write TOPIC TYPE FILE COUNT PERIOD_MS
//   fast_dds_peer DOMAIN call SERVICE REQUEST_TYPE RESPONSE_TYPE FILE [plain]
//
// Topics and types are DDS's ("rt/clock", "rosgraph_msgs::msg::dds_::Clock_"). Prints one JSON object at the end;
// `read` writes each message into FOLDER as NUMBER_OF_TOPIC-NUMBER.cdr.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fstream>
#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t kMaxBytes = 64U << 20U;

/// Bytes that are encoded already.
class RawType : public TopicDataType {
 public:
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = kMaxBytes;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<std::string*>(data);
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<std::string*>(data)->assign(reinterpret_cast<const char*>(payload->data), payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<std::string*>(data)->size()); };
  }
  void* createData() override { return new std::string; }
  void deleteData(void* data) override { delete static_cast<std::string*>(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*key*/, bool /*force_md5*/) override { return false; }
};

struct Wish {
  std::string topic, type;
  bool is_reliable = true, is_latched = false;
  std::size_t count = 1;
  std::string user_data;
};

std::string text_of(const std::vector<rtps::octet>& bytes) { return {bytes.begin(), bytes.end()}; }

/// Keeps what it is told of others.
class Discovered : public DomainParticipantListener {
 public:
  void on_participant_discovery(DomainParticipant* /*self*/, rtps::ParticipantDiscoveryInfo&& info) override {
    const std::lock_guard lock(mutex_);
    found_["participants"].push_back(
        {{"status", static_cast<int>(info.status)}, {"user_data", text_of(info.info.m_userData)}});
  }
  void on_publisher_discovery(DomainParticipant* /*self*/, rtps::WriterDiscoveryInfo&& info) override {
    if (info.status == rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) add("writers", info.info);
  }
  void on_subscriber_discovery(DomainParticipant* /*self*/, rtps::ReaderDiscoveryInfo&& info) override {
    if (info.status == rtps::ReaderDiscoveryInfo::DISCOVERED_READER) add("readers", info.info);
  }
  json found() const {
    const std::lock_guard lock(mutex_);
    return found_;
  }

 private:
  template <class Proxy>
  void add(const char* kind, const Proxy& proxy) {
    const std::lock_guard lock(mutex_);
    found_[kind].push_back({{"topic", proxy.topicName().c_str()},
                            {"type", proxy.typeName().c_str()},
                            {"reliable", proxy.m_qos.m_reliability.kind == RELIABLE_RELIABILITY_QOS},
                            {"latched", proxy.m_qos.m_durability.kind == TRANSIENT_LOCAL_DURABILITY_QOS},
                            {"user_data", text_of(proxy.m_qos.m_userData)}});
  }

  mutable std::mutex mutex_;
  json found_ = {{"participants", json::array()}, {"writers", json::array()}, {"readers", json::array()}};
};

/// Takes a topic's messages: files, and how long each was on its way, from the writer's time stamp. In a thread of its
/// own: a listener that takes more than the message that it is told of stops Debian's Fast DDS at an assertion.
class Collector : public DataReaderListener {
 public:
  explicit Collector(std::string stem) : stem_(std::move(stem)) {}

  void on_subscription_matched(DataReader* /*reader*/, const SubscriptionMatchedStatus& status) override {
    has_writer_ = status.current_count > 0;
    has_lost_writer_ = status.current_count == 0 && status.total_count > 0;
  }
  bool has_writer() const { return has_writer_; }
  bool has_lost_writer() const { return has_lost_writer_; }  ///< all that wrote have gone

  void start(DataReader* reader) {
    thread_ = std::jthread([this, reader](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (reader->wait_for_unread_message({0, 50'000'000})) take(reader);
      }
    });
  }
  void stop() { thread_ = {}; }

  void take(DataReader* reader) {
    std::string bytes;
    SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const auto now = std::chrono::system_clock::now().time_since_epoch();
      const std::lock_guard lock(mutex_);
      if (info.source_timestamp.to_ns() > 0)  // not all that is sent again has a time
        latencies_ms_.push_back(
            static_cast<double>(std::chrono::nanoseconds(now).count() - info.source_timestamp.to_ns()) * 1e-6);
      times_s_.push_back(std::chrono::duration<double>(now).count());
      if (!stem_.empty()) std::ofstream(stem_ + "-" + std::to_string(times_s_.size() - 1) + ".cdr") << bytes;
      last_ = bytes;
    }
  }
  std::size_t count() const {
    const std::lock_guard lock(mutex_);
    return times_s_.size();
  }
  std::string last() const {
    const std::lock_guard lock(mutex_);
    return last_;
  }
  json report() const {
    const std::lock_guard lock(mutex_);
    return {{"count", times_s_.size()}, {"latencies_ms", latencies_ms_}, {"times_s", times_s_}};
  }

 private:
  std::string stem_;
  std::atomic<bool> has_writer_{false}, has_lost_writer_{false};
  mutable std::mutex mutex_;
  std::vector<double> latencies_ms_, times_s_;
  std::string last_;
  std::jthread thread_;
};

/// A participant with its entities, as many as it is asked for.
class Peer {
 public:
  explicit Peer(std::uint32_t domain) {
    DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
    qos.transport().use_builtin_transports = false;
    const auto transport = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    transport->interfaceWhiteList.emplace_back("127.0.0.1");  // as rmw_fastrtps_cpp with ROS_LOCALHOST_ONLY=1
    transport->receiveBufferSize =
        4U << 20U;  // a burst of fragments of an image of a megabyte fits (sysctl net.core.rmem_max)
    qos.transport().user_transports.push_back(transport);
    participant_ =
        DomainParticipantFactory::get_instance()->create_participant(domain, qos, &discovered_, StatusMask::none());
    if (participant_ == nullptr) throw std::runtime_error("no participant");
    publisher_ = participant_->create_publisher(PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  }
  ~Peer() {
    for (const auto& collector : collectors_) collector->stop();
    participant_->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// Begins to read a topic; messages go to files if there is a stem.
  Collector& read(const Wish& wish, const std::string& stem) {
    Collector& collector = *collectors_.emplace_back(std::make_unique<Collector>(stem));
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = wish.is_reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = wish.is_latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 100;
    qos.user_data().data_vec({wish.user_data.begin(), wish.user_data.end()});
    qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
    DataReader* reader = subscriber_->create_datareader(topic(wish.topic, wish.type), qos, &collector);
    if (reader == nullptr) throw std::runtime_error("no reader");
    collector.start(reader);
    return collector;
  }
  DataWriter* writer(const std::string& name, const std::string& type, const std::string& user_data = "") {
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 100;
    qos.user_data().data_vec({user_data.begin(), user_data.end()});
    qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
    DataWriter* made = publisher_->create_datawriter(topic(name, type), qos);
    if (made == nullptr) throw std::runtime_error("no writer");
    return made;
  }
  json found() const { return discovered_.found(); }

 private:
  Topic* topic(const std::string& name, const std::string& type) {
    TypeSupport support(new RawType(type));
    support.register_type(participant_);
    return participant_->create_topic(name, type, TOPIC_QOS_DEFAULT);
  }

  Discovered discovered_;
  std::vector<std::unique_ptr<Collector>> collectors_;  ///< outlive the readers
  DomainParticipant* participant_ = nullptr;
  Publisher* publisher_ = nullptr;
  Subscriber* subscriber_ = nullptr;
};

template <class Condition>
bool wait_until(double seconds, const Condition& condition) {
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

std::string read_file(const std::string& name) {
  std::ostringstream text;
  text << std::ifstream(name, std::ios::binary).rdbuf();
  return text.str();
}

bool has_reader(DataWriter* writer) {
  PublicationMatchedStatus status;
  writer->get_publication_matched_status(status);
  return status.current_count > 0;
}

using Arguments = std::vector<std::string>;

json discover(Peer& peer, const Arguments& words) {
  std::this_thread::sleep_for(std::chrono::duration<double>(std::stod(words.at(0))));
  return peer.found();
}

json read(Peer& peer, const Arguments& words) {
  std::vector<Wish> wishes;
  std::vector<Collector*> collectors;
  for (std::size_t i = 2; i + 4 < words.size(); i += 5) {
    wishes.push_back(
        {words[i], words[i + 1], words[i + 2] == "reliable", words[i + 3] == "latched", std::stoul(words[i + 4])});
    const std::string stem = words[0] == "-" ? "" : words[0] + "/" + std::to_string(wishes.size() - 1);
    collectors.push_back(&peer.read(wishes.back(), stem));
  }
  std::size_t last_total = 0;
  auto last_news = Clock::now();
  wait_until(std::stod(words.at(1)), [&] {
    std::size_t total = 0;
    bool has_wishes = true, are_alone = true;
    for (std::size_t i = 0; i < wishes.size(); ++i) {
      total += collectors[i]->count();
      has_wishes &= collectors[i]->count() >= wishes[i].count;
      are_alone &= collectors[i]->has_lost_writer();
    }
    if (total != last_total || !are_alone) last_news = Clock::now();
    last_total = total;
    // The last samples before the writers ended may not have been taken yet.
    return has_wishes || Clock::now() - last_news > std::chrono::seconds(1);
  });
  json report;
  for (std::size_t i = 0; i < wishes.size(); ++i) report[wishes[i].topic] = collectors[i]->report();
  return report;
}

json write(Peer& peer, const Arguments& words) {
  DataWriter* writer = peer.writer(words.at(0), words.at(1));
  if (!wait_until(20, [&] { return has_reader(writer); })) return {{"error", "nobody reads " + words[0]}};
  std::this_thread::sleep_for(std::chrono::seconds(1));  // until the other side knows the writer, too
  std::string bytes = read_file(words.at(2));
  for (long i = std::stol(words.at(3)); i > 0; --i) {
    writer->write(&bytes);
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(std::stod(words.at(4))));
  }
  writer->wait_for_acknowledgments({5, 0});
  return {{"written", words.at(3)}};
}

/// The file is the request's CDR; what is written has the client's number and the request's before it, unless "plain".
json call(Peer& peer, const Arguments& words) {
  const std::string client = "clientid=1.2.3;";
  Collector& replies = peer.read({"rr" + words.at(0) + "Reply", words.at(2), true, false, 1, client}, "");
  DataWriter* writer = peer.writer("rq" + words.at(0) + "Request", words.at(1), client);
  if (!wait_until(20, [&] { return has_reader(writer) && replies.has_writer(); }))
    return {{"error", "no such service"}};
  std::string bytes = read_file(words.at(3));
  const std::uint64_t header[2] = {0x1122334455667788U, 7};
  if (words.size() < 5) bytes.insert(4, reinterpret_cast<const char*>(header), sizeof header);
  // A writer knows its reader before that knows it; what is written in between is lost, as DDS has it. A request that
  // is not to be answered is sent as often, in less time.
  const double patience_s = words.size() < 5 ? 2.0 : 0.5;
  const bool is_answered = [&] {
    for (int i = 0; i < 6; ++i) {
      writer->write(&bytes);
      if (wait_until(patience_s, [&] { return replies.count() > 0; })) return true;
    }
    return false;
  }();
  if (!is_answered) return {{"error", "no reply"}};
  const std::string reply = replies.last();
  std::string hexadecimal;
  for (const char c : reply) {
    constexpr const char* kDigits = "0123456789abcdef";
    hexadecimal += kDigits[static_cast<unsigned char>(c) >> 4U];
    hexadecimal += kDigits[static_cast<unsigned char>(c) & 15U];
  }
  return {{"reply", hexadecimal}};
}

}  // namespace

int main(int argc, char** argv) try {
  const Arguments words(argv + 1, argv + argc);
  const std::string& verb = words.at(1);
  const Arguments rest(words.begin() + 2, words.end());
  Peer peer(static_cast<std::uint32_t>(std::stoul(words.at(0))));
  const json result = verb == "discover" ? discover(peer, rest)
                      : verb == "read"   ? read(peer, rest)
                      : verb == "write"  ? write(peer, rest)
                                         : call(peer, rest);
  std::cout << result.dump() << std::endl;
  return 0;
} catch (const std::exception& error) {
  std::cerr << error.what() << std::endl;
  return 1;
}
