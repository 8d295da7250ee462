#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/http_provider.h"
#include "tileflight/tiles/provider_google.h"

namespace tileflight::tiles {

struct IonOptions {
  std::string api = "https://api.cesium.com";
  std::string asset;  ///< its number
  std::string token;
  GoogleOptions google;  ///< for assets that are Google's tiles; its key and root come from ion
};

/// An asset of Cesium ion (REST API, "Assets: access tiles"): the user's token gets an endpoint, that is, a URL and an
/// access token for the asset, which goes with each request of that origin as a bearer. The access token runs out after
/// an hour; a 401 gets another one, once a request. An external asset ("externalType": its tiles are elsewhere) is
/// asked for at the URL that the endpoint names, with what that URL carries; Google's tiles keep Google's protocol and
/// terms.
class IonProvider : public HttpProvider {
 public:
  /// Throws InputError: no token, no number.
  explicit IonProvider(const IonOptions& options);

  std::string open(HttpClient& client) override;
  HttpRequest request(const std::string& uri) override;
  void learn(const std::string& uri, std::span<const std::byte> body) override;
  void refresh(HttpClient& client) override;
  bool renew(HttpClient& client, long status, int generation) override;
  int generation() const override;
  std::vector<std::string> secrets() const override;
  std::vector<std::string> attribution() const override;
  Terms terms() const override;

 private:
  struct Endpoint {
    std::string url;
    std::string access_token;  ///< empty: external
    std::vector<std::string> attribution;
  };

  Endpoint get_endpoint(HttpClient& client) const;

  IonOptions options_;
  std::unique_ptr<HttpProvider> external_;  ///< who serves an external asset; set by `open`
  std::string name_;                        ///< for messages
  std::vector<std::string> attribution_;
  std::mutex renewing_;                     ///< one endpoint request at a time
  mutable std::mutex mutex_;                ///< of what follows
  std::vector<std::string> access_tokens_;  ///< all so far; the last one is in use
};

/// What an attribution's HTML says as plain text: its text, or where it is a picture, that picture's title.
std::string text_of_html(const std::string& html);

}  // namespace tileflight::tiles
