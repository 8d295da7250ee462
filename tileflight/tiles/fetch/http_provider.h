#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/http_client.h"
#include "tileflight/tiles/fetch/terms.h"

namespace tileflight::fetch {

/// A network service that serves a tileset. It knows the root URL and what requests must carry. URIs of the tileset are
/// kept without credentials; the provider adds them only to requests. Thread safe.
class HttpProvider {
 public:
  virtual ~HttpProvider() = default;

  /// Determines the root URL of the tileset, without credentials. Called once, before any other method. Throws
  /// InputError.
  virtual std::string resolve_root_url(HttpClient& client) = 0;
  /// Returns the request for a URI of the tileset's own origin: its URL with credentials, and its headers.
  virtual HttpRequest make_request(const std::string& uri) = 0;
  /// Throws InputError for a URI of the tileset's own origin that must not be requested.
  virtual void require_allowed(const std::string& /*uri*/) const {}
  /// Called with each response, before it is used.
  virtual void observe_response(const std::string& /*uri*/, std::span<const std::byte> /*body*/) {}
  /// Called before waiting for a request: renews credentials that are about to expire. Throws InputError.
  virtual void refresh_credentials(HttpClient& /*client*/) {}
  /// Called after a response with `status` to a request made with credentials of `generation`. Returns true if newer
  /// credentials are available and the request should be repeated. Throws InputError.
  virtual bool renew_credentials(HttpClient& /*client*/, long /*status*/, int /*generation*/) { return false; }
  /// Returns how many times credentials were obtained so far.
  virtual int credential_generation() const { return 0; }
  /// Explains an error code of the service to the user; empty if the code is clear by itself.
  virtual std::string explain(const std::string& /*code*/) const { return ""; }
  /// Returns the strings that must appear neither in messages nor on disk.
  virtual std::vector<std::string> secrets() const { return {}; }
  /// Returns the terms of use of the service.
  virtual TermsOfUse terms() const = 0;
  /// Returns the rights holders to credit in addition to those named by the tiles.
  virtual std::vector<std::string> attribution() const { return {}; }
};

/// A plain server: a URL and the user's own headers.
class UrlProvider : public HttpProvider {
 public:
  /// `headers`: "Name: value". Secret parameters of the URL (a signature, a key) are added to all requests of its
  /// origin that have none of their own. Throws InputError for an invalid header.
  explicit UrlProvider(const std::string& url, std::vector<std::string> headers = {});

  std::string resolve_root_url(HttpClient& client) override;
  HttpRequest make_request(const std::string& uri) override;
  std::vector<std::string> secrets() const override;
  /// Returns Google's terms if the host is Google's; otherwise unknown terms.
  TermsOfUse terms() const override;

 private:
  std::string url_;
  std::vector<std::string> headers_;
};

/// Returns the header in the form in which it is sent, "Name: value". Throws InputError if it is malformed or contains
/// more than one header.
std::string validate_header(const std::string& header);

}  // namespace tileflight::fetch
