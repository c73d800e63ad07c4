// SPDX-License-Identifier: Apache-2.0
// Goal: LSTM and GRU step by step, forward, backward and both, with and without initial states.
// Method: an independent scalar recurrence in double precision, written from the equations of the ONNX specification
// (https://onnx.ai/onnx/operators/onnx__LSTM.html, onnx__GRU.html), on random weights.
#include <cmath>
#include <random>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

double logistic(double x) {
  return 1.0 / (1.0 + std::exp(-x));
}

struct Net {
  std::size_t gates;
  std::string direction = "forward";
  bool initial = false;
  bool reset_after = false;  // GRU's linear_before_reset
  std::size_t sequence = 5, batch = 2, input = 3, hidden = 11;
  std::vector<float> x{}, w{}, r{}, b{}, h0{}, c0{};

  std::size_t directions() const { return direction == "bidirectional" ? 2 : 1; }

  void fill(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> number(-0.8F, 0.8F);
    const std::size_t d = directions();
    for (auto& [values, count] : {std::pair{&x, sequence * batch * input}, std::pair{&w, d * gates * hidden * input},
                                  std::pair{&r, d * gates * hidden * hidden}, std::pair{&b, d * 2 * gates * hidden},
                                  std::pair{&h0, d * batch * hidden}, std::pair{&c0, d * batch * hidden}}) {
      values->resize(count);
      for (float& value : *values) value = number(random);
    }
  }

  GraphMaker graph() const {
    const auto n = [](std::size_t size) { return static_cast<std::int64_t>(size); };
    const std::int64_t d = n(directions());
    GraphMaker maker(14);
    maker.input("x", {n(sequence), n(batch), n(input)}).output("y").output("y_h");
    maker.floats("w", {d, n(gates * hidden), n(input)}, w).floats("r", {d, n(gates * hidden), n(hidden)}, r);
    maker.floats("b", {d, n(2 * gates * hidden)}, b);
    std::vector<std::string> inputs{"x", "w", "r", "b"};
    std::vector<std::string> outputs{"y", "y_h"};
    if (initial) {
      maker.input("h0", {d, n(batch), n(hidden)});
      inputs.insert(inputs.end(), {"", "h0"});
      if (gates == 4) {
        maker.input("c0", {d, n(batch), n(hidden)});
        inputs.push_back("c0");
      }
    }
    if (gates == 4) {
      maker.output("y_c");
      outputs.push_back("y_c");
    }
    NodeMaker node = maker.node(gates == 4 ? "LSTM" : "GRU", inputs, outputs);
    node.with("hidden_size", n(hidden)).with("direction", direction);
    if (reset_after) node.with("linear_before_reset", std::int64_t{1});
    return maker;
  }

  std::vector<std::vector<float>> inputs() const {
    if (!initial) return {x};
    return gates == 4 ? std::vector{x, h0, c0} : std::vector{x, h0};
  }

  // weight * vector + bias of one row of one gate
  double input_share(std::size_t d, std::size_t row, const float* xt) const {
    double sum = static_cast<double>(b[d * 2 * gates * hidden + row]);
    for (std::size_t k = 0; k < input; ++k)
      sum += static_cast<double>(w[(d * gates * hidden + row) * input + k]) * static_cast<double>(xt[k]);
    return sum;
  }
  double state_share(std::size_t d, std::size_t row, const std::vector<double>& h) const {
    double sum = static_cast<double>(b[(d * 2 + 1) * gates * hidden + row]);
    for (std::size_t k = 0; k < hidden; ++k)
      sum += static_cast<double>(r[(d * gates * hidden + row) * hidden + k]) * h[k];
    return sum;
  }
};

struct States {
  std::vector<float> y, y_h, y_c;
};

void lstm_step(const Net& net, std::size_t d, const float* xt, std::vector<double>& h, std::vector<double>& c) {
  const std::size_t n = net.hidden;
  const std::vector<double> before = h;
  for (std::size_t j = 0; j < n; ++j) {
    const auto gate = [&](std::size_t g) {
      return net.input_share(d, g * n + j, xt) + net.state_share(d, g * n + j, before);
    };
    c[j] = logistic(gate(2)) * c[j] + logistic(gate(0)) * std::tanh(gate(3));
    h[j] = logistic(gate(1)) * std::tanh(c[j]);
  }
}

void gru_step(const Net& net, std::size_t d, const float* xt, std::vector<double>& h) {
  const std::size_t n = net.hidden;
  const std::vector<double> before = h;
  std::vector<double> z(n), reset(n), reset_h(n);
  for (std::size_t j = 0; j < n; ++j) {
    z[j] = logistic(net.input_share(d, j, xt) + net.state_share(d, j, before));
    reset[j] = logistic(net.input_share(d, n + j, xt) + net.state_share(d, n + j, before));
    reset_h[j] = reset[j] * before[j];
  }
  for (std::size_t j = 0; j < n; ++j) {
    const double from_state =
        net.reset_after ? reset[j] * net.state_share(d, 2 * n + j, before) : net.state_share(d, 2 * n + j, reset_h);
    h[j] = (1.0 - z[j]) * std::tanh(net.input_share(d, 2 * n + j, xt) + from_state) + z[j] * before[j];
  }
}

States reference(const Net& net) {
  const std::size_t n = net.hidden;
  States states;
  states.y.resize(net.sequence * net.directions() * net.batch * n);
  for (std::size_t d = 0; d < net.directions(); ++d) {
    const bool backward = net.direction == "reverse" || d == 1;
    for (std::size_t row = 0; row < net.batch; ++row) {
      std::vector<double> h(n, 0.0), c(n, 0.0);
      for (std::size_t j = 0; net.initial && j < n; ++j) {
        h[j] = static_cast<double>(net.h0[(d * net.batch + row) * n + j]);
        c[j] = static_cast<double>(net.c0[(d * net.batch + row) * n + j]);
      }
      for (std::size_t step = 0; step < net.sequence; ++step) {
        const std::size_t t = backward ? net.sequence - 1 - step : step;
        const float* xt = net.x.data() + (t * net.batch + row) * net.input;
        if (net.gates == 4) {
          lstm_step(net, d, xt, h, c);
        } else {
          gru_step(net, d, xt, h);
        }
        for (std::size_t j = 0; j < n; ++j) {
          states.y[((t * net.directions() + d) * net.batch + row) * n + j] = static_cast<float>(h[j]);
        }
      }
      for (std::size_t j = 0; j < n; ++j) {
        states.y_h.push_back(static_cast<float>(h[j]));
        states.y_c.push_back(static_cast<float>(c[j]));
      }
    }
  }
  return states;
}

void PrintTo(const Net& net, std::ostream* out) {
  *out << (net.gates == 4 ? "LSTM " : "GRU ") << net.direction << (net.initial ? " with" : " without")
       << " initial state" << (net.reset_after ? ", linear_before_reset" : "");
}

class Recurrent : public testing::TestWithParam<Net> {};

TEST_P(Recurrent, FollowsTheEquations) {
  Net net = GetParam();
  net.fill(3);
  const States expected = reference(net);
  const auto as_shape = [](std::initializer_list<std::size_t> sizes) { return Dims(sizes.begin(), sizes.end()); };
  const Dims sequence_shape = as_shape({net.sequence, net.directions(), net.batch, net.hidden});
  const Dims state_shape = as_shape({net.directions(), net.batch, net.hidden});
  expect_near(evaluate(net.graph(), net.inputs(), 0), sequence_shape, expected.y, 2e-6F);
  expect_near(evaluate(net.graph(), net.inputs(), 1), state_shape, expected.y_h, 2e-6F);
  if (net.gates == 4) expect_near(evaluate(net.graph(), net.inputs(), 2), state_shape, expected.y_c, 2e-6F);
}

std::vector<Net> nets() {
  std::vector<Net> all;
  for (const char* direction : {"forward", "reverse", "bidirectional"}) {
    for (const bool initial : {false, true}) {
      all.push_back({.gates = 4, .direction = direction, .initial = initial});
      all.push_back({.gates = 3, .direction = direction, .initial = initial});
      all.push_back({.gates = 3, .direction = direction, .initial = initial, .reset_after = true});
    }
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(Operators, Recurrent, testing::ValuesIn(nets()));

TEST(RecurrentRefusal, NamesTheVariantItDoesNotKnow) {
  Net net{.gates = 4};
  net.fill(1);
  const auto refused = [&net](const std::string& attribute, const auto& value) {
    GraphMaker maker = net.graph();
    NodeMaker(*maker.graph().mutable_node(0)).with(attribute, value);
    return maker.refusal();
  };
  EXPECT_NE(refused("clip", 3.0F).find("clip"), std::string::npos);
  EXPECT_NE(refused("layout", std::int64_t{1}), "");
  EXPECT_NE(refused("input_forget", std::int64_t{1}).find("coupled"), std::string::npos);
  EXPECT_NE(refused("activations", std::vector<std::string>{"Relu", "Tanh", "Tanh"}).find("activations"),
            std::string::npos);
  EXPECT_EQ(refused("activations", std::vector<std::string>{"Sigmoid", "Tanh", "Tanh"}), "");
}

}  // namespace
}  // namespace takt::onnx_engine
