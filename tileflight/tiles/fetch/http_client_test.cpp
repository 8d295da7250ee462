#include "tileflight/tiles/fetch/http_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <future>
#include <optional>

#include "tileflight/tiles/fetch/test_http_server.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::fetch::http_client_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_text;
using std::chrono::milliseconds;
using test_support::ServedConnection;
using test_support::ServedRequest;
using test_support::TestHttpServer;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Timeouts in milliseconds, so that simulated faults end soon.
HttpOptions quick() {
  HttpOptions options;
  options.connect_timeout = milliseconds(2000);
  options.stall_timeout = milliseconds(2000);
  options.whole_timeout = milliseconds(20'000);
  options.max_response_bytes = 1 << 20;
  options.retry = {.max_tries = 3,
                   .initial_backoff = milliseconds(2),
                   .max_backoff = milliseconds(8),
                   .max_retry_after = milliseconds(3000)};
  return options;
}

HttpRequest to(const std::string& url) {
  HttpRequest request;
  request.url = url;
  return request;
}

std::string gzipped(const std::string& text) {
  z_stream stream{};
  deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

/// Outcome of a request to a faulty server: the bytes, or one error.
struct Told {
  std::string text;
  std::string error;
  long status = 0;
  int tries = 0;
  int served = 0;
};

Told ask(const TestHttpServer::Handler& handler, const HttpOptions& options = quick()) {
  TestHttpServer server(handler);
  HttpClient client(options);
  Told told;
  told.error = base::test_support::error_of([&] {
    const HttpResponse response = client.get(to(server.url("/a.glb?key=SECRET")));
    told.text = base::test_support::to_text(response.body);
    told.status = response.status;
    told.tries = response.tries;
  });
  told.served = static_cast<int>(server.requests().size());
  EXPECT_THAT(told.error, ::testing::Not(HasSubstr("SECRET")));
  return told;
}

TEST(HttpClient, FetchesBytesAndHeaders) {
  TestHttpServer server([](const ServedRequest& request, ServedConnection& connection) {
    return connection.answer(200, "body of " + request.target + request.header("x-own"), {"ETag: \"1\"", "X-A: b"});
  });
  HttpClient client(quick());
  HttpRequest request = to(server.url("/dir/a.glb?v=1"));
  request.headers = {"X-Own: !"};
  const HttpResponse response = client.get(request);
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(base::test_support::to_text(response.body), "body of /dir/a.glb?v=1!");
  EXPECT_EQ(response.header("etag"), "\"1\"");
  EXPECT_EQ(response.header("x-a"), "b");
  EXPECT_EQ(response.header("none"), "");
  EXPECT_EQ(response.tries, 1);
}

TEST(HttpClient, PackedAnswersAreUnpacked) {
  const std::string text(5000, 'x');
  const Told told = ask([&](const ServedRequest& request, ServedConnection& connection) {
    EXPECT_THAT(request.header("accept-encoding"), AllOf(HasSubstr("gzip"), HasSubstr("br")));
    return connection.answer(200, gzipped(text), {"Content-Encoding: gzip"});
  });
  EXPECT_EQ(told.text, text) << told.error;
}

TEST(HttpClient, ASmallPackedAnswerThatGrowsWithoutEndIsRefused) {
  const std::string bomb = gzipped(std::string(8 << 20, '\0'));
  EXPECT_LT(bomb.size(), 100'000U);
  const Told told = ask([&](const ServedRequest&, ServedConnection& connection) {
    return connection.answer(200, bomb, {"Content-Encoding: gzip"});
  });
  EXPECT_THAT(told.error, HasSubstr("more than the 1048576 bytes allowed"));
  EXPECT_EQ(told.served, 1) << "another try would be the same";
}

TEST(HttpClient, OtherStatusesAreAnswers) {
  const Told told =
      ask([](const ServedRequest&, ServedConnection& connection) { return connection.answer(404, "nothing here"); });
  EXPECT_EQ(told.status, 404);
  EXPECT_EQ(told.served, 1);
}

TEST(HttpClient, AnErrorOfTheServerIsTriedAgain) {
  std::atomic<int> count = 0;
  const Told told = ask([&](const ServedRequest&, ServedConnection& connection) {
    return connection.answer(++count < 3 ? 500 : 200, "good");
  });
  EXPECT_EQ(told.text, "good");
  EXPECT_EQ(told.tries, 3);
}

TEST(HttpClient, AnErrorThatStaysIsNamedWithTheTries) {
  const Told told =
      ask([](const ServedRequest&, ServedConnection& connection) { return connection.answer(503, "no"); });
  EXPECT_THAT(told.error, AllOf(HasSubstr("/a.glb?key=…: answered with status 503"), HasSubstr("3 tries")));
  EXPECT_EQ(told.served, 3);
}

TEST(HttpClient, WaitsAsLongAsItIsAskedTo) {
  std::atomic<int> count = 0;
  const Told told = ask([&](const ServedRequest&, ServedConnection& connection) {
    if (++count == 1) return connection.answer(429, "", {"Retry-After: 0"});
    return connection.answer(200, "good");
  });
  EXPECT_EQ(told.text, "good");
  EXPECT_EQ(told.tries, 2);

  // A request told to wait an hour is delayed, while all tries of another one are completed.
  std::promise<void> asked_to_wait;
  std::atomic<int> busy_requests = 0, other_requests = 0;
  TestHttpServer server([&](const ServedRequest& request, ServedConnection& connection) {
    if (request.path() != "/busy") {
      ++other_requests;
      return connection.answer(503, "");
    }
    if (++busy_requests == 1) asked_to_wait.set_value();
    return connection.answer(429, "", {"Retry-After: 3600"});
  });
  HttpOptions options = quick();
  options.max_parallel = 1;
  options.whole_timeout = std::chrono::hours(2);
  options.retry.max_retry_after = std::chrono::hours(2);
  std::promise<std::string> busy;
  std::optional<HttpClient> client(options);
  client->start(to(server.url("/busy")), [&](const HttpResult& result) {
    busy.set_value(result.failure ? result.failure->what() : "answered");
  });
  asked_to_wait.get_future().wait();
  EXPECT_THAT(error_of([&] { client->get(to(server.url("/other"))); }), HasSubstr("3 tries"));
  EXPECT_EQ(other_requests, 3);
  EXPECT_EQ(busy_requests, 1);
  client.reset();
  EXPECT_THAT(busy.get_future().get(), HasSubstr("cancelled"));
}

TEST(HttpClient, DoesNotWaitLongerThanItMay) {
  const Told told = ask([&](const ServedRequest&, ServedConnection& connection) {
    return connection.answer(429, "", {"Retry-After: 86400"});
  });
  EXPECT_THAT(told.error, AllOf(HasSubstr("429"), HasSubstr("asks to wait 86400 s")));
  EXPECT_EQ(told.served, 1);
}

TEST(HttpClient, ABodyThatBreaksOffIsFetchedAgain) {
  std::atomic<int> count = 0;
  const auto broken_until = [&](int good) {
    return [&count, good](const ServedRequest&, ServedConnection& connection) {
      if (++count == good) return connection.answer(200, "0123456789");
      connection.send("HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\n01234");
      return false;
    };
  };
  EXPECT_EQ(ask(broken_until(2)).text, "0123456789");
  count = 0;
  EXPECT_THAT(ask(broken_until(9)).error, AllOf(HasSubstr("closed early, after 5 bytes"), HasSubstr("3 tries")));
}

TEST(HttpClient, AConnectionThatIsResetIsOpenedAgain) {
  std::atomic<int> count = 0;
  const auto reset_until = [&](int good) {
    return [&count, good](const ServedRequest&, ServedConnection& connection) {
      if (++count == good) return connection.answer(200, "good");
      connection.reset_at_end();
      return false;
    };
  };
  EXPECT_EQ(ask(reset_until(3)).text, "good");
  count = 0;
  EXPECT_THAT(ask(reset_until(99)).error, AllOf(HasSubstr("cannot be fetched"), HasSubstr("3 tries")));
}

TEST(HttpClient, AResetWithinTheBodyIsNoAnswer) {
  const Told told = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n01234\r\n");
    connection.reset_at_end();
    return false;
  });
  EXPECT_THAT(told.error, HasSubstr("3 tries"));
}

TEST(HttpClient, ADripIsAStall) {
  HttpOptions options = quick();
  options.stall_timeout = milliseconds(150);
  options.stall_bytes = 200;
  const Told told = ask(
      [](const ServedRequest&, ServedConnection& connection) {
        connection.send("HTTP/1.1 200 OK\r\nContent-Length: 100000\r\n\r\n");
        for (int i = 0; i < 200 && connection.send("x"); ++i) connection.wait(milliseconds(10));
        return false;
      },
      options);
  EXPECT_THAT(told.error, AllOf(HasSubstr("stalled: fewer than 200 bytes in 150 ms"), HasSubstr("3 tries")));
}

TEST(HttpClient, SilenceIsAStallAndASlowButSteadyAnswerIsNot) {
  HttpOptions options = quick();
  options.stall_timeout = milliseconds(600);
  options.stall_bytes = 50;
  options.retry.max_tries = 1;
  const Told silent = ask(
      [](const ServedRequest&, ServedConnection& connection) {
        connection.wait(milliseconds(5000));
        return false;
      },
      options);
  EXPECT_THAT(silent.error, HasSubstr("stalled"));
  const Told steady = ask(
      [](const ServedRequest&, ServedConnection& connection) {
        connection.send("HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n");
        for (int i = 0; i < 10; ++i) {
          connection.wait(milliseconds(60));
          connection.send(std::string(100, 'x'));
        }
        return true;
      },
      options);
  EXPECT_EQ(steady.text.size(), 1000U) << steady.error;
}

TEST(HttpClient, TheWholeIsBoundedWhateverTrickles) {
  HttpOptions options = quick();
  options.whole_timeout = milliseconds(400);
  const Told told = ask(
      [](const ServedRequest&, ServedConnection& connection) {
        connection.send("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n");
        while (connection.send("400\r\n" + std::string(0x400, 'x') + "\r\n")) connection.wait(milliseconds(20));
        return false;
      },
      options);
  EXPECT_THAT(told.error, HasSubstr("took longer than 400 ms"));
}

TEST(HttpClient, AnAnnouncedSizeIsCheckedBeforeAnythingIsKept) {
  const Told told = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("HTTP/1.1 200 OK\r\nContent-Length: 99999999999999999999999\r\n\r\nx");
    connection.wait(milliseconds(50));
    return false;
  });
  EXPECT_THAT(told.error, HasSubstr("/a.glb?key=…: "));
  const Told large = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("HTTP/1.1 200 OK\r\nContent-Length: 1048577\r\n\r\nx");
    connection.wait(milliseconds(50));
    return false;
  });
  EXPECT_THAT(large.error, HasSubstr("declares 1048577 bytes, more than the 1048576 allowed"));
  EXPECT_EQ(large.served, 1);
}

TEST(HttpClient, EndlessBodiesAndHeadsEnd) {
  const Told body = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("HTTP/1.1 200 OK\r\n\r\n");
    while (connection.send(std::string(65536, 'x'))) {
    }
    return false;
  });
  EXPECT_THAT(body.error, HasSubstr("sends more than the 1048576 bytes allowed"));
  const Told head = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("HTTP/1.1 200 OK\r\n");
    while (connection.send("X-Header: " + std::string(1000, 'x') + "\r\n")) {
    }
    return false;
  });
  EXPECT_THAT(head.error, HasSubstr("bytes of headers"));
}

TEST(HttpClient, ALengthThatIsTooShortGivesWhatWasAnnounced) {
  const Told told = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\n0123456789");
    return false;
  });
  EXPECT_EQ(told.text, "0123") << told.error;
}

TEST(HttpClient, NoAnswerAtAllOrNoneOfHttp) {
  const Told nothing = ask([](const ServedRequest&, ServedConnection&) { return false; });
  EXPECT_THAT(nothing.error, HasSubstr("3 tries"));
  const Told garbage = ask([](const ServedRequest&, ServedConnection& connection) {
    connection.send("SSH-2.0-OpenSSH\r\n");
    return false;
  });
  EXPECT_THAT(garbage.error, HasSubstr("cannot be fetched"));
}

TEST(HttpClient, NobodyListens) {
  int port = 0;
  {
    port = TestHttpServer([](const ServedRequest&, ServedConnection&) { return false; }).port();
  }
  HttpClient client(quick());
  EXPECT_THAT(base::test_support::error_of(
                  [&] { client.get(to("http://127.0.0.1:" + std::to_string(port) + "/a?token=SECRET")); }),
              AllOf(HasSubstr("/a?token=…: cannot be fetched"), HasSubstr("3 tries")));
}

TEST(HttpClient, RedirectsAreFollowedWhereThatIsAllowed) {
  TestHttpServer server([](const ServedRequest& request, ServedConnection& connection) {
    if (request.path() == "/loop") return connection.answer(302, "", {"Location: /loop"});
    if (request.path() == "/old") return connection.answer(301, "", {"Location: sub/new?v=2"});
    if (request.path() == "/out") return connection.answer(307, "", {"Location: file:///etc/passwd"});
    return connection.answer(200, request.target + " " + request.header("x-own"));
  });
  HttpClient client(quick());
  const auto ask_for = [&](const std::string& path) {
    HttpRequest request = to(server.url(path));
    request.headers = {"X-Own: first"};
    request.headers_for_redirect = [](const std::string& target) -> std::vector<std::string> {
      if (target.starts_with("file:")) throw InputError(target, "may not be named");
      return {"X-Own: second"};
    };
    return client.get(request);
  };
  const HttpResponse response = ask_for("/old");
  EXPECT_EQ(base::test_support::to_text(response.body), "/sub/new?v=2 second");
  EXPECT_EQ(response.url, server.url("/sub/new?v=2"));
  EXPECT_TRUE(response.redirected);
  EXPECT_EQ(response.tries, 1);
  EXPECT_THAT(base::test_support::error_of([&] { ask_for("/loop"); }), HasSubstr("redirected more than 5 times"));
  EXPECT_EQ(server.count("/loop"), 6);
  EXPECT_THAT(base::test_support::error_of([&] { ask_for("/out"); }),
              HasSubstr("is redirected, but file:///etc/passwd: may not be named"));
  EXPECT_THAT(base::test_support::error_of([&] { client.get(to(server.url("/old"))); }),
              HasSubstr("which is not allowed"));
}

TEST(HttpClient, ConnectionsAreKeptAndRequestsAtOnceAreBounded) {
  TestHttpServer server([](const ServedRequest& request, ServedConnection& connection) {
    connection.wait(milliseconds(5));
    return connection.answer(200, request.target);
  });
  HttpOptions options = quick();
  options.max_parallel = 4;
  std::vector<std::promise<std::string>> answers(40);
  HttpClient client(options);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    client.start(to(server.url("/" + std::to_string(i))), [&answers, i](HttpResult outcome) {
      answers[i].set_value(outcome.failure ? outcome.failure->what()
                                           : base::test_support::to_text(outcome.response.body));
    });
  }
  for (std::size_t i = 0; i < answers.size(); ++i) {
    EXPECT_EQ(answers[i].get_future().get(), "/" + std::to_string(i));
  }
  EXPECT_LE(server.most_at_once(), 4);
  EXPECT_GE(server.most_at_once(), 2);
  EXPECT_LE(server.connections(), 4);
}

TEST(HttpClient, UrgentRequestsComeFirst) {
  std::mutex mutex;
  std::vector<std::string> order;
  TestHttpServer server([&](const ServedRequest& request, ServedConnection& connection) {
    {
      const std::lock_guard lock(mutex);
      order.push_back(request.target);
    }
    connection.wait(milliseconds(request.target == "/0" ? 100 : 1));
    return connection.answer(200, "");
  });
  HttpOptions options = quick();
  options.max_parallel = 1;
  std::promise<void> last;
  HttpClient client(options);
  for (int i = 0; i < 5; ++i) {
    client.start(to(server.url("/" + std::to_string(i))), [&last, i](const HttpResult&) {
      if (i == 4) last.set_value();
    });
  }
  client.get(to(server.url("/urgent")));
  last.get_future().get();
  const auto place = std::find(order.begin(), order.end(), "/urgent") - order.begin();
  EXPECT_LE(place, 2) << "behind those at most that had begun";
}

TEST(HttpClient, WhatIsUnderWayEndsWithTheClient) {
  TestHttpServer server([](const ServedRequest&, ServedConnection& connection) {
    connection.wait(milliseconds(60'000));
    return false;
  });
  std::vector<std::string> ends;
  {
    HttpClient client;
    for (int i = 0; i < 30; ++i) {
      client.start(to(server.url("/a?key=SECRET")), [&](const HttpResult& result) {
        ends.push_back(result.failure ? result.failure->what() : "answered");
      });
    }
  }
  EXPECT_EQ(ends.size(), 30U);
  EXPECT_THAT(ends, testing::Each(HasSubstr("/a?key=…: cancelled")));
}

}  // namespace
}  // namespace tileflight::fetch::http_client_test

namespace tileflight::fetch::http_retry_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(HttpRetry, RetryAfterInBothForms) {
  constexpr std::time_t kNow = 784111777;  // Sun, 06 Nov 1994 08:49:37 GMT
  EXPECT_EQ(parse_retry_after("120", kNow), seconds(120));
  EXPECT_EQ(parse_retry_after(" 0 ", kNow), seconds(0));
  EXPECT_EQ(parse_retry_after("Sun, 06 Nov 1994 08:50:07 GMT", kNow), seconds(30));
  EXPECT_EQ(parse_retry_after("Sun, 06 Nov 1994 08:00:00 GMT", kNow), seconds(0)) << "has passed";
  EXPECT_EQ(parse_retry_after("99999999999999999999", kNow), seconds(1'000'000'000));
  EXPECT_EQ(parse_retry_after("soon", kNow), std::nullopt);
  EXPECT_EQ(parse_retry_after("-3", kNow), std::nullopt);
  EXPECT_EQ(parse_retry_after("", kNow), std::nullopt);
}

TEST(HttpRetry, WaitsDoubleWithinBoundsAndSpread) {
  const RetryOptions options{.initial_backoff = milliseconds(100), .max_backoff = milliseconds(1000)};
  EXPECT_EQ(backoff(options, 1, 0), milliseconds(50));
  EXPECT_EQ(backoff(options, 1, 0xFFFFFFFF), milliseconds(99));
  EXPECT_EQ(backoff(options, 3, 0), milliseconds(200));
  EXPECT_EQ(backoff(options, 3, 0x80000000), milliseconds(300));
  EXPECT_EQ(backoff(options, 60, 0), milliseconds(500)) << "no more than half of the longest, at least";
}

TEST(HttpRetry, StatusesThatMayChange) {
  for (const long status : {408, 429, 500, 502, 503, 504}) EXPECT_TRUE(is_retryable_status(status)) << status;
  for (const long status : {200, 304, 400, 401, 403, 404, 410, 501})
    EXPECT_FALSE(is_retryable_status(status)) << status;
}

}  // namespace
}  // namespace tileflight::fetch::http_retry_test
