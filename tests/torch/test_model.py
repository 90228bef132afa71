"""Functions of PyTorch beside the robot's own, their gradients beside differences and the compiled
derivatives, and what they refuse."""

from __future__ import annotations

import pickle
import sys
from itertools import pairwise

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.autograd import gradcheck, gradgradcheck

import linkwork as lw
import linkwork.torch
from linkwork import LinkworkError
from linkwork.gradients.compilation import compiled
from linkwork.mechanism.transmissions import Cable, ViaPoint
from linkwork.torch.differentiable_model import TorchModel

from tests.catalogue import WHOLE, built, open_chain, with_a_hand
from tests.robot.test_gear_teeth import hoist

NAMES = ["five_bar", "rrs3", *["prr3"] * WHOLE]
TWICE = ["five_bar", "spatial_slider_crank", *["rrs3", "prr3"] * WHOLE]


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return built("prr3")


@pytest.fixture(scope="module")
def model(robot) -> TorchModel:
    return linkwork.torch.model(robot)


def state_of(model: TorchModel, seed: int = 0) -> tuple[Tensor, Tensor, Tensor]:
    """A closed configuration near home, rates and forces."""
    random = torch.Generator().manual_seed(seed)

    def numbers(size: int) -> Tensor:
        return torch.randn(size, generator=random, dtype=torch.float64)

    q = model.closed(model.q + 0.01 * numbers(len(model.q)))
    return q, 0.3 * numbers(len(model.v)), numbers(len(model.arrays["u"]))


def wanting(*tensors: Tensor) -> list[Tensor]:
    return [tensor.detach().clone().requires_grad_() for tensor in tensors]


def require_gradients(f, *tensors: Tensor) -> None:
    given = wanting(*tensors)
    assert gradcheck(f, given, eps=1e-6, atol=1e-6, fast_mode=True)
    assert gradgradcheck(f, given, eps=1e-6, atol=1e-5, fast_mode=True)


@pytest.mark.long
@pytest.mark.parametrize("name", TWICE)
def test_gradients_of_first_and_second_order_are_those_of_differences(name):
    model = linkwork.torch.model(built(name))
    q, v, u = state_of(model)
    require_gradients(model.forward_dynamics, q, v, u)
    require_gradients(model.inverse_dynamics, q, v, u)
    require_gradients(model.closed, q)
    require_gradients(lambda q: model.tool_pose(q=q), q)
    require_gradients(lambda *x: torch.cat(model.step(*x, 1e-2), -1), q, v, u)


@pytest.mark.parametrize("hinges", [1, 4])
def test_gradients_by_a_quaternion_are_those_of_differences_along_its_length_too(hinges):
    """On a floating base with a chain: few links by M, many by articulated inertias."""
    own = lw.Body(
        mass=1.3, centre_of_mass=(0.1, 0.02, -0.05), inertia=lw.Inertia(xx=0.02, yy=0.03, zz=0.04)
    )
    names = ["base", *(f"link_{k}" for k in range(hinges))]
    joints: dict = {"free": lw.FreeJoint(connects=("ground", "base"))}
    for k, pair in enumerate(pairwise(names)):
        axis, at = (1, 0, 0) if k % 2 else (0, 1, 0), lw.Frame(position=(0.3, 0.1, 0.0))
        joints[f"hinge_{k}"] = lw.RevoluteJoint(connects=pair, frames=(at, lw.Frame()), axis=axis)
    robot = lw.Robot(lw.Mechanism(bodies=dict.fromkeys(names, own), joints=joints))
    assert robot.equations.recursive == (hinges > 1)
    model = linkwork.torch.model(robot)
    q, v, u = state_of(model)
    given = (*wanting(q), v, u)
    assert gradcheck(model.forward_dynamics, given, eps=1e-6, atol=1e-6, fast_mode=True)


def test_a_stop_that_is_not_touched_has_no_derivatives_of_any_order():
    law = lw.Stop(lower=0.0, stiffness=3e4, restitution=0.6)
    body = lw.Body(mass=0.5, inertia=lw.Inertia(xx=1, yy=1, zz=1))
    slide = lw.PrismaticJoint(connects=("ground", "body"), stop=law)
    robot = lw.Robot(lw.Mechanism(bodies={"body": body}, joints={"z": slide}))
    model, none = linkwork.torch.model(robot), torch.zeros(0)

    def accelerate(z: Tensor) -> Tensor:
        return model.forward_dynamics(z, torch.zeros(1), none)

    second = torch.func.jacrev(torch.func.jacrev(accelerate))
    for z, k in ((0.1, 0.0), (0.0, 0.0), (-0.01, 0.75 * 3e4 / 0.5 / 0.1)):
        assert float(second(torch.tensor([z], dtype=torch.float64))) == pytest.approx(k, rel=1e-12)
    with pytest.raises(LinkworkError, match="not finite"):
        accelerate(torch.tensor([float("nan")]))


def driven_arm() -> lw.Robot:
    """Return two links with a rotor, drawn by a cable behind a lagging drive."""
    link = lw.Body(mass=1.0, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.02))
    shoulder = lw.RevoluteJoint(connects=("ground", "a"), rotor_inertia=0.3)
    at = lw.Frame(position=(0.4, 0, 0)), lw.Frame()
    path = ViaPoint(body="ground", point=(0.1, 0.3, 0)), ViaPoint(body="b", point=(0.3, 0.1, 0))
    return lw.Robot(
        lw.Mechanism(
            bodies={"a": link, "b": link},
            joints={"p": shoulder, "q": lw.RevoluteJoint(connects=("a", "b"), frames=at)},
            transmissions={"cable": Cable(path=path)},
            actuators=("cable", "p"),
            drives={"cable": {"type": "lag", "time_constant": 0.1}},
        )
    )


@pytest.mark.parametrize("make", [driven_arm, lambda: hoist(rate=0.1)])
def test_cables_rotors_and_teeth_are_differentiated(make):
    robot = make()
    model = linkwork.torch.model(robot)
    assert [note for note in model.notes if "drives of cable" in note] == [*model.notes]
    assert len(model.notes) == len(robot.mechanism.drives)
    q, v, u = (x + 0.3 for x in state_of(model))
    q = model.closed(q)
    expected = robot.forward_dynamics(robot.make_state(q.numpy(), v.numpy()), u.numpy())
    np.testing.assert_allclose(model.forward_dynamics(q, v, u), expected, rtol=1e-12)
    assert gradcheck(model.forward_dynamics, wanting(q, v, u), atol=1e-5, fast_mode=True)


def test_gradients_by_free_numbers_and_through_a_rollout():
    robot = lw.Robot("five_bar").free("gravity.y")
    model = linkwork.torch.model(robot)
    q, v, u = state_of(model)
    forces = torch.stack([u, -u, 0.5 * u])

    def end(v: Tensor, forces: Tensor, p: Tensor) -> Tensor:
        Q, V = model.rollout(q, v, forces, 1e-2, p)
        return torch.cat([Q[-1], V[-1]])

    require_gradients(end, v, forces, model.p)


@pytest.mark.parametrize("name", NAMES)
def test_values_are_the_robot_s_own(name):
    robot = built(name)
    model = linkwork.torch.model(robot)
    q, v, u = state_of(model)
    Q, V, U = (torch.stack([x, 0.9 * x]) if x is not q else torch.stack([q, q]) for x in (q, v, u))
    states = robot.make_state(Q.numpy(), V.numpy())
    expected = robot.forward_dynamics(states, U.numpy())
    np.testing.assert_allclose(model.forward_dynamics(Q, V, U), expected, rtol=1e-13, atol=1e-12)
    run = robot.simulate(states.at(0), u.numpy(), duration=0.02, method="rk4", step=1e-3)
    Q, V = model.rollout(q, v, u.expand(20, -1), 1e-3)
    assert Q.shape == (21, len(q)) and torch.equal(Q[0], q)
    np.testing.assert_allclose(V[-1], run.final.rates, rtol=0, atol=1e-9)
    assert float(model.closure(Q[-1])[0].abs().max()) < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", NAMES)
def test_gradients_along_closed_loops_are_those_that_are_compiled(name):
    robot = built(name)
    model = linkwork.torch.model(robot)
    q, v, u = state_of(model)
    kernel = compiled(robot.chart, "forward_dynamics", "jacobian")
    own = dict(zip([name for name, _ in kernel.outputs], kernel(q, v, u), strict=True))
    by_q, by_v, by_u = torch.func.jacrev(model.forward_dynamics, (0, 1, 2))(q, v, u)
    along = torch.func.jacrev(model.coordinate_rates, 1)(q, v)
    found = {"by_q": by_q @ along, "by_v": by_v, "by_given": by_u}
    for what, slope in found.items():
        wanted = own[what].reshape(slope.T.shape).T
        np.testing.assert_allclose(slope, wanted, rtol=1e-9, atol=1e-9, err_msg=what)


@pytest.mark.long
def test_it_is_batched_and_traced_whole(model):
    q, _, u = state_of(model)
    Q = torch.stack([model.closed(q + 0.01 * k) for k in range(4)])
    V = torch.randn(4, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    expected = torch.stack([model.forward_dynamics(a, b, u) for a, b in zip(Q, V, strict=True)])
    batched = torch.func.vmap(model.forward_dynamics, (0, 0, None))
    assert torch.equal(batched(Q, V, u), expected)
    assert torch.equal(model.forward_dynamics(Q, V, u), expected)

    slopes = torch.func.vmap(torch.func.jacrev(model.forward_dynamics, 1), (0, 0, None))
    one = torch.func.jacrev(model.forward_dynamics, 1)(Q[2], V[2], u)
    torch.testing.assert_close(slopes(Q, V, u)[2], one, rtol=1e-14, atol=1e-14)

    def loss(q: Tensor, v: Tensor, u: Tensor) -> Tensor:
        return model.step(q, v, u, 1e-3)[1].square().sum()

    traced = torch.compile(loss, backend="aot_eager", fullgraph=True)
    given, plain = wanting(Q, V, u), wanting(Q, V, u)
    traced(*given).backward()
    loss(*plain).backward()
    for found, wanted in zip(given, plain, strict=True):
        torch.testing.assert_close(found.grad, wanted.grad, rtol=1e-12, atol=1e-12)


def test_numbers_of_any_kind_are_doubles_and_h_is_not_rounded(model):
    q, v, u = state_of(model)
    one = model.step(q, v, u, 1e-3)
    other = model.step(q.numpy(), v.tolist(), u, torch.tensor(1e-3, dtype=torch.float64))
    assert torch.equal(one[0], other[0]) and torch.equal(one[1], other[1])
    assert model.forward_dynamics(q.float(), v, u).dtype is torch.float64


@pytest.mark.filterwarnings("error")
def test_arrays_that_may_only_be_read_are_taken_without_a_warning(model):
    q = model.q.numpy().copy()
    q.flags.writeable = False
    torch.set_warn_always(True)  # PyTorch warns once a process
    try:
        assert torch.equal(model.closed(q), model.closed(model.q))
    finally:
        torch.set_warn_always(False)


def test_what_is_given_and_what_is_found_share_no_memory(model):
    """Loops that are closed already are passed on, and rows may be one row that is read often."""
    closed = torch.tensor(model.closed(model.q).tolist(), dtype=torch.float64)
    found = model.closed(closed.expand(3, -1))
    found[0] += 1.0
    torch.testing.assert_close(found[1:], model.q.expand(2, -1))
    torch.testing.assert_close(closed, model.q)
    # An array that changes between a call and its gradient.
    q, u = model.q.numpy().copy(), torch.zeros(3, requires_grad=True)
    (told,) = torch.autograd.grad(model.forward_dynamics(q, model.v, u).sum(), u)
    dv = model.forward_dynamics(q, model.v, u).sum()
    q += 0.05
    assert torch.equal(torch.autograd.grad(dv, u)[0], told)


def test_results_by_name_have_their_shapes(model):
    q, v, _ = state_of(model)
    assert model.mass_matrix(q.expand(5, -1)).shape == (5, 3, 3)
    assert model.energy(q, v).kinetic.shape == ()
    assert "forward_dynamics" in dir(model) and "rollout" in model.functions
    assert "slide_1" in repr(model) and "3-PRR" in repr(model)


def test_functions_that_are_offered_are_there_and_others_are_refused(robot, model):
    """In the shapes of CasADi's, at home."""
    q, random = robot.home.q, np.random.default_rng(3)
    for name in model.functions[:-3]:
        f = robot.functions()[name]
        given = [q, *(random.normal(size=f.numel_in(i)) for i in range(1, f.n_in()))]
        found, wanted = getattr(model, name)(*given), [np.array(y) for y in f.call(given)]
        for y, other in zip(found if isinstance(found, tuple) else [found], wanted, strict=False):
            other = wanted[1] if name == "forward_dynamics" else other
            np.testing.assert_allclose(y.numpy().ravel(), other.ravel(), rtol=1e-9, atol=1e-9)
    assert "reactions" not in model.functions
    with pytest.raises(AttributeError, match=r"no expressions; robot\.reactions does"):
        _ = model.reactions


def refusals(model):
    q, v, u = state_of(model)
    one = model.forward_dynamics
    return [
        (lambda: one(q[:3], v, u), r"q of forward_dynamics has the shape \(3,\).* 7 numbers"),
        (lambda: one("q", v, u), "q of forward_dynamics is 'q'; give an array of real numbers"),
        (lambda: one(q + 0j, v, u), "give an array of real numbers"),
        (lambda: one(q.expand(3, -1), v.expand(2, -1), u), "do not fit together"),
        (lambda: one(q, v, u, model.p), "takes no p"),
        (lambda: one(torch.stack([q, q * torch.nan]), v, u), "3-PRR, state 1: .*not finite"),
        (lambda: model.closed(0 * q), "the loops are left open"),
        (lambda: model.step(q, 40 * v, u, 0.5), "on the way the rates slide_1|not finite|motion"),
        (lambda: model.mass_matrix(q, v, u), "was given 3 arrays; give 1: q"),
        (lambda: model.mass_matrix(q > 0), "q of mass_matrix is .*; give an array of real numbers"),
        (lambda: model.rollout(q, v, u, 1e-3), "give a row of forces for each step"),
    ]


@pytest.mark.parametrize("number", range(10))
def test_what_cannot_be_done_is_refused_in_a_sentence(model, number):
    call, said = refusals(model)[number]
    with pytest.raises(LinkworkError, match=said):
        call()


@pytest.mark.parametrize("make", [with_a_hand, open_chain])
def test_closed_refuses_numbers_that_are_in_no_loop(make):
    robot = make()
    model, quiet = (linkwork.torch.model(robot, singular=how) for how in ("raise", "nan"))
    q = model.q.repeat(2, 1)
    q[1, robot.equations.tree.coordinates.index("pin")] = torch.nan
    with pytest.raises(LinkworkError, match=r"closed of .*state 1: the result is not finite"):
        model.closed(q)
    found = quiet.closed(q)
    assert torch.isfinite(found[0]).all() and torch.isnan(found[1]).all()
    assert gradcheck(model.closed, wanting(model.q), fast_mode=True)


def test_singular_states_are_an_error_or_nan_of_their_own(robot):
    arm = lw.Robot("four_bar")
    model = linkwork.torch.model(arm, singular="nan")
    q, v, u = state_of(model)
    found = model.forward_dynamics(torch.stack([q, q * torch.nan]), v, u)
    assert torch.isfinite(found[0]).all() and torch.isnan(found[1]).all()
    with pytest.raises(LinkworkError, match='singular is \'never\'; give "raise" or "nan"'):
        linkwork.torch.model(robot, singular="never")  # pyright: ignore


def test_a_step_that_is_not_defined_has_no_gradient():
    model = linkwork.torch.model(lw.Robot("four_bar"), singular="nan")
    rates = torch.tensor([[0.1], [20.0]], dtype=torch.float64, requires_grad=True)
    q, v = model.step(model.q, rates, torch.zeros(1), torch.tensor([1e-3, 0.2]))
    assert torch.isfinite(q[0]).all() and torch.isnan(q[1]).all()
    (slope,) = torch.autograd.grad(q.sum() + v.sum(), rates)
    assert torch.isfinite(slope[0]).all() and torch.isnan(slope[1]).all()


def test_what_is_not_closed_for_want_of_numbers_has_no_gradient_without_loops_either():
    model = linkwork.torch.model(lw.Robot("double_pendulum"), singular="nan")
    q = torch.tensor([[0.1, 0.2], [torch.nan, 0.3], [torch.inf, 1.0]], requires_grad=True)
    (slope,) = torch.autograd.grad((model.closed(q.double()) * torch.tensor([2.0, 3.0])).sum(), q)
    np.testing.assert_array_equal(slope, [[2.0, 3.0], [torch.nan] * 2, [torch.nan] * 2])


def test_a_model_is_pickled_as_what_it_was_made_of(model):
    again = pickle.loads(pickle.dumps(model))
    q, v, u = state_of(model)
    assert torch.equal(again.forward_dynamics(q, v, u), model.forward_dynamics(q, v, u))


def test_a_third_derivative_is_refused(model):
    q, v, u = state_of(model)

    def f(v: Tensor) -> Tensor:
        return model.forward_dynamics(q, v, u).sum()

    with pytest.raises(LinkworkError, match="first and second order; a third one"):
        torch.func.jacrev(torch.func.jacrev(torch.func.jacrev(f)))(v)


def test_without_pytorch_what_to_install_is_said(robot, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(LinkworkError, match=r"pip install 'linkwork\[torch\]'"):
        linkwork.torch.model(robot)
