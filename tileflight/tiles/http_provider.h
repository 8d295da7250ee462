#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/http_client.h"
#include "tileflight/tiles/terms.h"

namespace tileflight::tiles {

/// Who serves a tileset over the network: where it starts, and what its requests have to carry. URIs of the tileset are
/// kept without credentials; a provider adds them to the request alone. Safe from several threads at once.
class HttpProvider {
 public:
  virtual ~HttpProvider() = default;

  /// Finds out where the tileset starts: its root URL, without credentials. Called once, before all else. Throws
  /// InputError.
  virtual std::string open(HttpClient& client) = 0;
  /// What to add for a URI of the tileset's own origin: the URL to ask, and headers.
  virtual HttpRequest request(const std::string& uri) = 0;
  /// Called with each answer, before it is used.
  virtual void learn(const std::string& /*uri*/, std::span<const std::byte> /*body*/) {}
  /// Called before a request is waited for: renews credentials that are about to run out. Throws InputError.
  virtual void refresh(HttpClient& /*client*/) {}
  /// After an answer of this status to a request that `request` made while credentials were of this generation: true
  /// where others have been obtained, and it is worth asking again. Throws InputError.
  virtual bool renew(HttpClient& /*client*/, long /*status*/, int /*generation*/) { return false; }
  /// Counts the credentials that were obtained.
  virtual int generation() const { return 0; }
  /// What must stand in no message and nowhere on disk.
  virtual std::vector<std::string> secrets() const { return {}; }
  virtual Terms terms() const = 0;
  /// Holders to name beside those that the tiles name.
  virtual std::vector<std::string> attribution() const { return {}; }
};

/// A plain server: a URL and the user's own headers.
class PlainProvider : public HttpProvider {
 public:
  /// `headers`: "Name: value". Secret parameters of the URL (a signature, a key) are sent with all requests of its
  /// origin that have none of their own. Throws InputError for a header that is none.
  explicit PlainProvider(const std::string& url, std::vector<std::string> headers = {});

  std::string open(HttpClient& client) override;
  HttpRequest request(const std::string& uri) override;
  std::vector<std::string> secrets() const override;
  /// Google's where the host is Google's; else not known.
  Terms terms() const override;

 private:
  std::string url_;
  std::vector<std::string> headers_;
};

/// "Name: value" as it is sent. Throws InputError where it is not of that form or would be more than one header.
std::string checked_header(const std::string& header);

}  // namespace tileflight::tiles
