#include "tileflight/live/rpc/server.h"

#include <gmock/gmock.h>

#include <atomic>
#include <condition_variable>
#include <csignal>
#include <mutex>
#include <random>
#include <thread>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/rpc/connection.h"
#include "tileflight/live/rpc/test_client.h"

namespace tileflight::rpc::server_test {
namespace {

using std::chrono::milliseconds;
using testing::Contains;
using testing::HasSubstr;
using testing::ThrowsMessage;

bool soon(const std::function<bool()>& condition) {
  for (int i = 0; i < 5000 && !condition(); ++i) std::this_thread::sleep_for(milliseconds(1));
  return condition();
}

/// A server with a few methods, one of which waits until another is called.
class ServerTest : public testing::Test {
 protected:
  void start(const ServerOptions& options = {}) {
    server_ = std::make_unique<Server>(methods(), options, [this](const std::string& line) {
      const std::lock_guard lock(mutex_);
      log_.push_back(line);
    });
    network_ = std::thread([this] { server_->run(); });
  }

  void TearDown() override {
    if (!server_) return;
    release();
    server_->stop();
    network_.join();
    server_.reset();
  }

  MethodTable methods() {
    MethodTable table;
    table.add<bool>("ping", [] { return true; });
    table.add<float, float, float>("add", [](float a, float b) { return a + b; });
    table.add<std::string, std::string>("echo", [](std::string text) { return text; });
    table.add<std::string, std::string, std::string>("echo",
                                                     [](const std::string& a, const std::string& b) { return a + b; });
    table.add<std::vector<std::uint8_t>, std::uint32_t>(
        "blob", [](std::uint32_t n) { return std::vector<std::uint8_t>(n, 7); });
    table.add<void>("fail", []() { throw std::runtime_error("it is \xff raining\nagain"); });
    table.add<bool>("wait", [this] { return wait(); });
    table.add<bool>("fly", [this] { return wait(); });
    table.mark_waiting("fly");
    table.add<void>("crash", [] { throw std::runtime_error("there is a wall"); });
    table.mark_waiting("crash");
    table.add<bool>("render", [this] { return wait(); });
    table.mark_slow("render");
    table.add<void>("release", [this] { release(); });
    table.add<int, std::vector<std::vector<float>>>(
        "count", [](const std::vector<std::vector<float>>& lists) { return static_cast<int>(lists.size()); });
    return table;
  }

  bool wait() {
    ++waiting_;
    std::unique_lock lock(mutex_);
    const bool done = released_.wait_for(lock, std::chrono::seconds(20), [this] { return is_released_; });
    --waiting_;
    return done;
  }

  void release() {
    const std::lock_guard lock(mutex_);
    is_released_ = true;
    released_.notify_all();
  }

  TestClient client(double patience_s = 10.0) const { return TestClient(server_->port(), patience_s); }

  bool serves() const {
    TestClient one = client();
    return one.ask(request_bytes(1, "ping")).has_value();
  }

  std::vector<std::string> log() {
    const std::lock_guard lock(mutex_);
    return log_;
  }

  std::string error_of(const std::string& request) const {
    const auto answer = client().ask(request);
    return answer ? decode_response(*answer).error.value_or("no error") : "no answer";
  }

  std::unique_ptr<Server> server_;
  std::thread network_;
  std::mutex mutex_;
  std::condition_variable released_;
  bool is_released_ = false;
  std::atomic<int> waiting_{0};
  std::vector<std::string> log_;
};

TEST_F(ServerTest, AnswersByteForByte) {
  start();
  EXPECT_EQ(client().ask(std::string("\x94\x00\x00\xa4ping\x90", 9)), std::string("\x94\x01\x00\xc0\xc3", 5));
  EXPECT_EQ(client().ask(std::string("\x94\x00\x07\xa3"
                                     "add\x92\x01\x02",
                                     10)),
            std::string("\x94\x01\x07\xc0\xca\x40\x40\x00\x00", 9));
  EXPECT_EQ(client().ask(std::string("\x94\x00\x01\xc4\x07release\x90", 13)), std::string("\x94\x01\x01\xc0\xc0", 5));
}

TEST_F(ServerTest, WordsErrorsAsClientsKnowThem) {
  start();
  EXPECT_EQ(error_of(request_bytes(1, "fail")),
            "rpclib: function 'fail' (called with 0 arg(s)) threw an exception. The exception contained this "
            "information: it is ? raining\nagain.");
  EXPECT_EQ(error_of(request_bytes(1, "echo", 1, 2, 3)),
            "rpclib: client error C0002: Function 'echo' was called with an invalid number of arguments. Expected: 1, "
            "got: 3");
  EXPECT_EQ(error_of(request_bytes(1, "fly\xff", 1)),
            "rpclib: server could not find function 'fly?' with argument count 1.");
  EXPECT_THAT(error_of(request_bytes(1, "add", 1, "two")), HasSubstr("argument 2: expected a number, got a string"));
}

TEST_F(ServerTest, ServesByTheNumberOfArguments) {
  start();
  EXPECT_EQ(decode_response(*client().ask(request_bytes(1, "echo", "a"))).result().as<std::string>(), "a");
  EXPECT_EQ(decode_response(*client().ask(request_bytes(1, "echo", "a", "b"))).result().as<std::string>(), "ab");
}

TEST_F(ServerTest, RequestsOfOneConnectionRunAtOnce) {
  start();
  TestClient one = client();
  ASSERT_TRUE(one.send(request_bytes(1, "wait") + request_bytes(2, "ping") + request_bytes(3, "release")));
  std::vector<std::uint32_t> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(decode_response(*one.receive()).id);
  EXPECT_THAT(ids, testing::UnorderedElementsAre(1, 2, 3));
}

TEST_F(ServerTest, ManyClientsAtOnce) {
  start();
  std::vector<std::thread> clients;
  std::atomic<int> right{0};
  for (int i = 0; i < 8; ++i) {
    clients.emplace_back([&, i] {
      TestClient one = client();
      for (int k = 0; k < 100; ++k) {
        const auto answer = one.ask(request_bytes(static_cast<std::uint32_t>(k), "add", i, k));
        if (answer && decode_response(*answer).result().as<float>() == static_cast<float>(i + k)) ++right;
      }
    });
  }
  for (std::thread& one : clients) one.join();
  EXPECT_EQ(right, 800);
  EXPECT_EQ(server_->statistics().methods.at("add").calls, 800U);
}

TEST_F(ServerTest, NotificationsAreRunAndNotAnswered) {
  start();
  TestClient one = client();
  EXPECT_TRUE(one.send(std::string("\x93\x02\xa7release\x90", 11)));
  EXPECT_TRUE(soon([this] {
    const std::lock_guard lock(mutex_);
    return is_released_;
  }));
  EXPECT_EQ(decode_response(*one.ask(request_bytes(5, "ping"))).id, 5U);
}

TEST_F(ServerTest, MessagesInPiecesAndMessagesAtOnce) {
  start();
  TestClient one = client();
  for (const char c : request_bytes(1, "echo", std::string(300, 'x'))) ASSERT_TRUE(one.send({&c, 1}));
  EXPECT_EQ(decode_response(*one.receive()).result().as<std::string>(), std::string(300, 'x'));
  std::string many;
  for (std::uint32_t i = 0; i < 1000; ++i) many += request_bytes(i, "ping");
  ASSERT_TRUE(one.send(many));
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(one.receive().has_value()) << i;
}

TEST_F(ServerTest, BigArraysAndAnswers) {
  start();
  TestClient one = client();
  const std::vector<std::vector<float>> lists(1000, std::vector<float>(500, 1.5F));
  EXPECT_EQ(decode_response(*one.ask(request_bytes(1, "count", lists))).result().as<int>(), 1000);
  const auto answer = one.ask(request_bytes(2, "blob", 20'000'000));
  EXPECT_EQ(decode_response(*answer).result().via.bin.size, 20'000'000U);
  EXPECT_TRUE(soon([this] { return server_->statistics().held_bytes == 0; }));
}

TEST_F(ServerTest, WhatIsNoMessageClosesTheConnectionAlone) {
  start();
  TestClient other = client();
  for (const std::string& bytes : {std::string("GET / HTTP/1.1\r\n\r\n"), std::string("\x94\x05\x00\xa4ping\x90", 9),
                                   std::string("\x94\x00\xa1x\xa4ping\x90", 10), std::string("\x93\x00\x00\x90", 4),
                                   std::string("\x94\x00\x00\x05\x90", 5), std::string("\x94\x00\x00\xa4ping\x05", 9),
                                   std::string("\x94\x00\x00\xdd\xff\xff\xff\xff", 8)}) {
    TestClient one = client();
    one.send(bytes);
    EXPECT_TRUE(one.is_closed());
  }
  EXPECT_TRUE(other.ask(request_bytes(1, "ping")).has_value());
  EXPECT_TRUE(soon([this] { return server_->statistics().connections_cut == 7; }));
  EXPECT_THAT(log(), Contains(HasSubstr("closed: a message of more than 1000000 values")));
}

TEST_F(ServerTest, TenThousandRandomMessages) {
  start({.limits = {.message_timeout_s = 0.05}});
  std::mt19937 random(5);
  std::unique_ptr<TestClient> one;
  const std::string valid = request_bytes(1, "add", 1, 2);
  for (int i = 0; i < 10'000; ++i) {
    std::string bytes = valid;
    if (i % 3 == 0) bytes = std::string(1 + random() % 64, '\0');
    for (char& c : bytes) {
      if (i % 3 == 0 || random() % 8 == 0) c = static_cast<char>(random());
    }
    if (!one || !one->send(bytes)) {
      one = std::make_unique<TestClient>(server_->port(), 1.0);
      one->send(bytes);
    }
  }
  one.reset();
  EXPECT_TRUE(serves());
  EXPECT_TRUE(soon([this] {
    const ServerStatistics statistics = server_->statistics();
    return statistics.connections == 0 && statistics.running == 0 && statistics.held_bytes == 0;
  }));
}

TEST_F(ServerTest, HalfAMessageIsWaitedForAWhile) {
  start({.limits = {.message_timeout_s = 0.1}});
  TestClient one = client();
  one.send(request_bytes(1, "ping").substr(0, 4));
  EXPECT_TRUE(one.is_closed());
  TestClient idle = client();
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_TRUE(idle.ask(request_bytes(1, "ping")).has_value());  // no message begun: no timeout
  EXPECT_THAT(log(), Contains(HasSubstr("incomplete message")));
}

TEST_F(ServerTest, AClientThatDoesNotReadIsCut) {
  start({.limits = {.max_queued_bytes = 1U << 20U}});
  TestClient one = client(2.0);
  for (std::uint32_t i = 0; i < 30; ++i) one.send(request_bytes(i, "blob", 8 << 20));
  EXPECT_TRUE(soon([this] { return server_->statistics().connections_cut == 1; }));
  EXPECT_THAT(log(), Contains(HasSubstr("not read")));
  EXPECT_TRUE(serves());
}

TEST_F(ServerTest, AnAnswerThatIsNeverTakenIsGivenUp) {
  start({.limits = {.write_timeout_s = 0.1}});
  TestClient one = client();
  one.send(request_bytes(1, "blob", 64 << 20));
  EXPECT_TRUE(soon([this] { return server_->statistics().connections_cut == 1; }));
  EXPECT_THAT(log(), Contains(HasSubstr("not read after")));
}

TEST_F(ServerTest, WhoHoldsTheMostIsCutWhenAllTogetherHoldTooMuch) {
  start({.limits = {.max_held_bytes = 4U << 20U}});
  TestClient modest = client();
  modest.send(request_bytes(1, "echo", std::string(1U << 20U, 'x')).substr(0, 1U << 20U));
  TestClient greedy = client();
  greedy.send(request_bytes(1, "echo", std::string(16U << 20U, 'x')));
  EXPECT_TRUE(greedy.is_closed());
  EXPECT_THAT(log(), Contains(HasSubstr("bytes waiting to be sent")));
  EXPECT_EQ(server_->statistics().connections, 1U);
}

TEST_F(ServerTest, MoreRequestsThanMayBePendingWaitInTheNetwork) {
  start({.limits = {.max_running_per_connection = 2, .max_pending_per_connection = 4}});
  TestClient one = client();
  for (std::uint32_t i = 0; i < 20; ++i) one.send(request_bytes(i, "wait"));
  EXPECT_TRUE(soon([this] { return waiting_ == 2 && server_->statistics().requests >= 4; }));
  std::this_thread::sleep_for(milliseconds(20));  // long enough to read more, if it were allowed
  EXPECT_EQ(server_->statistics().requests, 4U);
  release();
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(one.receive().has_value()) << i;
}

TEST_F(ServerTest, CallsThatWaitTakeNoOthersPlace) {
  start({.limits = {.max_running_per_connection = 2,
                    .max_pending_per_connection = 4,
                    .max_workers = 2,
                    .max_waiting_calls = 50}});
  TestClient one = client();
  for (std::uint32_t i = 0; i < 50; ++i) ASSERT_TRUE(one.send(request_bytes(i, "fly")));
  EXPECT_TRUE(soon([this] { return waiting_ == 50; })) << waiting_ << " of 50 fly";
  EXPECT_EQ(decode_response(one.ask(request_bytes(100, "ping")).value_or(request_bytes(0, ""))).id, 100U);
  EXPECT_TRUE(serves()) << "another client";
  ASSERT_TRUE(one.send(request_bytes(101, "fly")));
  EXPECT_TRUE(soon([this] { return waiting_ == 51; })) << "beyond the limit it is a call as any other";
  ASSERT_TRUE(one.send(request_bytes(102, "release")));
  for (int i = 0; i < 52; ++i) ASSERT_TRUE(one.receive().has_value()) << i;
  one.end_sending();
  EXPECT_TRUE(one.is_closed());
  EXPECT_TRUE(soon([this] { return server_->statistics().held_bytes == 0; }));
}

TEST_F(ServerTest, CallsThatComputeForLongKeepNoOtherWaiting) {
  start({.limits = {.max_running_per_connection = 2,
                    .max_pending_per_connection = 4,
                    .max_slow_pending_per_connection = 200,
                    .max_workers = 2}});
  TestClient one = client();
  for (std::uint32_t i = 0; i < 100; ++i) ASSERT_TRUE(one.send(request_bytes(i, "render")));
  EXPECT_TRUE(soon([this] { return waiting_ == 2; }));
  EXPECT_EQ(decode_response(one.ask(request_bytes(1000, "ping")).value_or(request_bytes(0, ""))).id, 1000U);
  EXPECT_TRUE(serves()) << "another client";
  for (std::uint32_t i = 100; i < 300; ++i) ASSERT_TRUE(one.send(request_bytes(i, "render")));
  EXPECT_TRUE(soon([this] { return server_->statistics().requests == 202; })) << "then reading pauses";
  std::this_thread::sleep_for(milliseconds(20));
  EXPECT_EQ(server_->statistics().requests, 202U);
  EXPECT_EQ(waiting_, 2);
  release();
  for (int i = 0; i < 300; ++i) ASSERT_TRUE(one.receive().has_value()) << i;
  one.end_sending();
  EXPECT_TRUE(one.is_closed());
  EXPECT_TRUE(soon([this] { return server_->statistics().held_bytes == 0; }));
}

TEST_F(ServerTest, ErrorsThatAClientMayNotSeeAreLogged) {
  start();
  EXPECT_THAT(error_of(request_bytes(1, "crash")), HasSubstr("there is a wall"));
  EXPECT_THAT(error_of(request_bytes(1, "crash", 5)), HasSubstr("invalid number of arguments"));
  EXPECT_THAT(error_of(request_bytes(1, "fly_on")), HasSubstr("could not find"));
  EXPECT_THAT(error_of(request_bytes(1, "fail")), HasSubstr("raining"));
  EXPECT_THAT(log(), testing::UnorderedElementsAre(HasSubstr("there is a wall"), HasSubstr("Expected: 0, got: 1"),
                                                   HasSubstr("could not find function 'fly_on'")));
  TestClient one = client();
  for (std::uint32_t i = 0; i < 300; ++i) ASSERT_TRUE(one.ask(request_bytes(i, "crash")).has_value());
  EXPECT_EQ(log().size(), 103U) << "a hundred of each client";
  EXPECT_THAT(log().back(), HasSubstr("further errors of this client are not logged"));
}

TEST(MethodOf, ReadsTheNameWithoutTheArguments) {
  EXPECT_EQ(method_of(request_bytes(70'000, "simGetImages", 1, "a")), "simGetImages");
  EXPECT_EQ(method_of(std::string("\x93\x02\xa4ping\x90", 8)), "ping") << "a notification";
  EXPECT_EQ(method_of(std::string("\xdc\x00\x04\x00\x01\xc4\x04ping\x90", 12)), "ping") << "other lengths of the same";
  for (const std::string& bytes :
       {std::string(), std::string("\x90"), std::string("\x94\x00\x00", 3), std::string("\xdd"),
        std::string("\x94\x00\x00\x00\x90", 5), std::string("\x94\x00\x00\xa9ping", 8)})
    EXPECT_EQ(method_of(bytes), "");
}

TEST_F(ServerTest, ClientsBeyondTheNumberAreRefused) {
  start({.limits = {.max_connections = 2}});
  TestClient one = client();
  TestClient two = client();
  ASSERT_TRUE(one.ask(request_bytes(1, "ping")) && two.ask(request_bytes(1, "ping")));
  EXPECT_TRUE(client().is_closed());
  EXPECT_EQ(server_->statistics().connections_refused, 1U);
}

/// A hundred that ask for 8 MB and do not read: those that find a place are cut in time, the others are refused, each
/// with a line; then others are served, and nothing is held.
TEST_F(ServerTest, AHundredSlowClientsAreALineEach) {
  start({.limits = {.max_connections = 16, .max_held_bytes = 64U << 20U, .write_timeout_s = 0.3}});
  std::vector<std::unique_ptr<TestClient>> slow;
  for (std::uint32_t i = 0; i < 100; ++i) {
    slow.push_back(std::make_unique<TestClient>(server_->port()));
    slow.back()->send(request_bytes(i, "blob", 8 << 20));
  }
  const auto told = [this] {
    const ServerStatistics seen = server_->statistics();
    return seen.connections_cut + seen.connections_refused;
  };
  EXPECT_TRUE(soon([&] { return told() == 100 && server_->statistics().connections == 0; })) << told();
  EXPECT_EQ(log().size(), 100U);
  EXPECT_TRUE(serves());
  EXPECT_TRUE(soon([this] { return server_->statistics().held_bytes == 0; }));
}

TEST_F(ServerTest, AClientThatSendsNoMoreStillGetsItsAnswers) {
  start({.limits = {.max_running_per_connection = 2, .max_pending_per_connection = 4, .message_timeout_s = 0.05}});
  TestClient one = client();
  one.send(request_bytes(1, "wait") + request_bytes(2, "wait"));
  for (std::uint32_t i = 3; i <= 10; ++i) one.send(request_bytes(i, "ping"));
  one.send(request_bytes(11, "ping").substr(0, 3));
  one.end_sending();
  ASSERT_TRUE(soon([this] { return waiting_ == 2; }));
  std::this_thread::sleep_for(milliseconds(100));  // does not wait for the rest of a message
  EXPECT_EQ(server_->statistics().connections, 1U);
  release();
  std::vector<std::uint32_t> ids;
  for (int i = 0; i < 10; ++i) ids.push_back(decode_response(one.receive().value_or(request_bytes(0, ""))).id);
  EXPECT_THAT(ids, testing::UnorderedElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
  EXPECT_TRUE(one.is_closed());
  EXPECT_TRUE(soon([this] { return server_->statistics().held_bytes == 0; }));
  EXPECT_EQ(server_->statistics().connections_cut, 0U);
}

TEST_F(ServerTest, AClientThatSendsNoMoreGivesWayToAnother) {
  start({.limits = {.max_connections = 2}});
  TestClient one = client();
  ASSERT_TRUE(one.ask(request_bytes(1, "ping")));
  TestClient two = client();
  two.send(request_bytes(1, "wait"));
  ASSERT_TRUE(soon([this] { return waiting_ == 1; }));
  two.end_sending();
  EXPECT_TRUE(soon([this] { return serves(); }));
  EXPECT_TRUE(two.is_closed());
  EXPECT_TRUE(one.ask(request_bytes(2, "ping")));
}

TEST_F(ServerTest, ClientsThatAreKilledLeaveNothingBehind) {
  start();
  for (int i = 0; i < 20; ++i) {
    const TestClient one = client();
    one.send(request_bytes(1, "wait") + request_bytes(2, "blob", 1 << 20) + request_bytes(3, "ping").substr(0, i % 8));
  }
  EXPECT_TRUE(soon([this] { return server_->statistics().connections == 0; }));
  release();
  EXPECT_TRUE(soon([this] {
    const ServerStatistics statistics = server_->statistics();
    return statistics.running == 0 && statistics.held_bytes == 0;
  }));
  EXPECT_TRUE(serves());
}

TEST_F(ServerTest, ATokenComesFirst) {
  start({.token = "secret"});
  TestClient one = client();
  EXPECT_THAT(decode_response(*one.ask(request_bytes(1, "ping"))).error.value_or(""), HasSubstr("requires a token"));
  EXPECT_TRUE(decode_response(*one.ask(request_bytes(2, "authenticate", "secret"))).result().via.boolean);
  EXPECT_TRUE(decode_response(*one.ask(request_bytes(3, "ping"))).result().via.boolean);
  TestClient wrong = client();
  wrong.send(request_bytes(1, "authenticate", "secreT"));
  EXPECT_TRUE(wrong.is_closed());
  TestClient big = client();
  big.send(request_bytes(1, "authenticate", std::string(100'000, 's')));
  EXPECT_TRUE(big.is_closed());
  EXPECT_THAT(log(), Contains(HasSubstr("wrong token")));
}

TEST_F(ServerTest, ATokenIsNotWaitedForLong) {
  start({.token = "secret", .limits = {.authentication_timeout_s = 0.1}});
  EXPECT_TRUE(client().is_closed());
}

TEST_F(ServerTest, StopsWhileCallsAreRunning) {
  start();
  TestClient one = client();
  one.send(request_bytes(1, "wait"));
  ASSERT_TRUE(soon([this] { return waiting_ == 1; }));
  server_->stop();
  EXPECT_TRUE(one.is_closed());
}

TEST_F(ServerTest, StopsAtASignal) {
  start();
  server_->stop_at_signals();
  ASSERT_TRUE(serves());
  std::raise(SIGTERM);
  network_.join();
  network_ = std::thread([] {});
}

TEST(ServerAddress, IsLoopbackOrNot) {
  EXPECT_TRUE(is_loopback("127.0.0.1"));
  EXPECT_TRUE(is_loopback("localhost"));
  EXPECT_TRUE(is_loopback("::1"));
  EXPECT_FALSE(is_loopback("0.0.0.0"));
  EXPECT_FALSE(is_loopback("192.168.1.2"));
  EXPECT_THAT([&] { is_loopback("the moon"); },
              ThrowsMessage<InputError>(HasSubstr("address the moon: is not an IPv4 or IPv6 address")));
}

TEST(ServerAddress, APortInUseIsAClearError) {
  const Server first({}, {});
  EXPECT_THAT([&] { Server({}, {.port = first.port()}); },
              testing::ThrowsMessage<InputError>(HasSubstr("cannot listen on it")));
}

TEST(Token, IsTheSameOrNot) {
  EXPECT_TRUE(equal_in_constant_time("secret", "secret"));
  EXPECT_FALSE(equal_in_constant_time("secret", "secreu"));
  EXPECT_FALSE(equal_in_constant_time("secret", "secretsecret"));
  EXPECT_FALSE(equal_in_constant_time("secretsecret", "secret"));
  EXPECT_FALSE(equal_in_constant_time("", "secret"));
  EXPECT_FALSE(equal_in_constant_time("", ""));
}

}  // namespace
}  // namespace tileflight::rpc::server_test
